// Lets a test see in numbers what a person sees in the scene: asks the lab for `world` messages in the page's own
// hello, and keeps the newest of each message. Installed before the page's scripts.
(() => {
  /** @type {SeenMessages} */
  const seen = { counts: {}, last: {}, frames: [] };
  window.__seen = seen;
  const Real = window.WebSocket;
  window.WebSocket = class extends Real {
    /**
     * @param {string | URL} url
     * @param {string | string[]} [protocols]
     */
    constructor(url, protocols) {
      super(url, protocols);
      this.addEventListener("message", (event) => {
        if (typeof event.data !== "string") return;
        const message = JSON.parse(event.data);
        seen.counts[message.type] = (seen.counts[message.type] ?? 0) + 1;
        seen.last[message.type] = message;
        seen.frames.push(event.data);
      });
    }
    /**
     * @param {string | BufferSource | Blob} data
     * @override
     */
    send(data) {
      if (typeof data === "string" && data.startsWith('{"type":"hello"')) {
        super.send(JSON.stringify({ ...JSON.parse(data), telemetry: true }));
      } else super.send(data);
    }
  };
})();
