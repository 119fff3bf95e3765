// SPDX-License-Identifier: BSD-3-Clause
// The page's connection to the server, in a thread of the browser that drawing does not hold up.
// Heartbeats say that the page is there. While the page itself does not answer, others say that its browser is: they hold
// a motion of one click, and no stream, for as long as the server allows. A page that nobody sees sends none.
const PAGE_SILENCE_MS = 500;
const RETRY_MS = 1000;

let socket = null;
let address = "";
let timer = 0;
let seen = performance.now();
let visible = true;
let hangs = 0;

function connect() {
  socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => postMessage({op: "connected", is: true});
  socket.onmessage = ({data}) => {
    if (data instanceof ArrayBuffer) {
      postMessage({op: "poses", data}, [data]);
      return;
    }
    const operation = JSON.parse(data);
    if (operation.op === "hello") {
      clearInterval(timer);
      timer = setInterval(beat, operation.heartbeat_ms);
      hangs = operation.hangs_ms;
    }
    postMessage(operation);
  };
  socket.onclose = () => {
    clearInterval(timer);
    postMessage({op: "connected", is: false});
    setTimeout(connect, RETRY_MS);
  };
}

function beat() {
  const silent = performance.now() - seen;
  if (!visible || silent >= hangs || socket.readyState !== WebSocket.OPEN) return;
  socket.send(silent < PAGE_SILENCE_MS ? "beat" : "busy");
}

onmessage = ({data}) => {
  seen = performance.now();
  if (data.visible !== undefined) visible = data.visible;
  if (data.address) {
    address = data.address;
    connect();
  } else if (data.op && socket.readyState === WebSocket.OPEN) {
    // A heartbeat first: the server takes operations of pages that it has heard.
    if (data.op !== "stop") socket.send("beat");
    socket.send(JSON.stringify(data));
  }
};
