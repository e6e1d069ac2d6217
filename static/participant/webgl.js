// Whether this browser can draw the robot at all.

/**
 * Draws nothing and leaves no context behind.
 *
 * @returns {boolean}
 */
export function canDraw() {
  try {
    const context = document.createElement("canvas").getContext("webgl2");
    context?.getExtension("WEBGL_lose_context")?.loseContext();
    return context !== null;
  } catch {
    return false;
  }
}
