// The WebSocket of frames and states. A lost connection is taken up again by itself, with back-off.

import { address } from "./api.js";
import { set } from "./store.js";

const FIRST_WAIT_MS = 400;
const LONGEST_WAIT_MS = 5000;

/** Keeps a connection for the life of the page; handlers are onState, onFrame, onLandmarks, onWalls and onOpen(). */
export function connect(handlers) {
  let socket;
  let wait = FIRST_WAIT_MS;
  let timer = 0;

  function attempt() {
    clearTimeout(timer);
    if (socket && socket.readyState <= WebSocket.OPEN) return;
    socket = new WebSocket(streamAddress());
    socket.onmessage = ({ data }) => receive(JSON.parse(data));
    socket.onopen = () => {
      wait = FIRST_WAIT_MS;
      set("connection", "open");
      handlers.onOpen();
    };
    socket.onclose = () => {
      set("connection", "lost");
      timer = setTimeout(attempt, wait * (0.8 + 0.4 * Math.random())); // many browsers do not return in step
      wait = Math.min(LONGEST_WAIT_MS, wait * 1.6);
    };
  }

  function receive(message) {
    if (message.type === "frame") handlers.onFrame(message);
    else if (message.type === "state") handlers.onState(message);
    else if (message.type === "landmarks") handlers.onLandmarks(message);
    else if (message.type === "walls") handlers.onWalls(message);
  }

  set("connection", "connecting");
  attempt();
  window.addEventListener("online", attempt);
  document.addEventListener("visibilitychange", () => document.hidden || attempt());
}

function streamAddress() {
  const url = address("stream");
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  return url;
}
