"use strict";
// Frames from the server that sent this page, over a websocket; opened again where it closes.

function connect(onHello, onFrame, onLost) {
  let socket = null;
  function open() {
    let first = true;
    socket = new WebSocket(location.href.replace(/^http/, "ws").replace(/[^/]*$/, "frames"));
    socket.onmessage = event => {
      const message = JSON.parse(event.data);
      if (first) { first = false; onHello(message); } else onFrame(message);
    };
    socket.onclose = () => { onLost(); setTimeout(open, 1000); };
  }
  open();
  return message => { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message)); };
}
