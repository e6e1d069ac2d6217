// A scene that draws five pictures a second, as on a slow computer: without a graphics card each takes a core's tenth of a
// second, which the tests beside it need. Everything else on the page is drawn as ever.
(() => {
  if (!location.pathname.includes("/scene/")) return;
  const BETWEEN_MS = 200;
  const next = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (draw) => setTimeout(() => next(draw), BETWEEN_MS);
  window.cancelAnimationFrame = (handle) => clearTimeout(handle);
})();
