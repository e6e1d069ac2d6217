// Whether this browser can draw the robot at all.

/**
 * Software drawing counts; WebGL 1 alone does not, with which viser draws nothing. It leaves no context behind.
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
