// Timers of hidden pages are slowed to once a minute; those of a worker are not. This one only beats.

let timer = 0;

addEventListener("message", (event) => {
  clearInterval(timer);
  if (event.data > 0) timer = setInterval(() => postMessage(null), event.data);
});
