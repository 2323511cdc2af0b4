"use strict";
// The page: each frame becomes numbers, words and pictures.

(() => {
  const byId = id => document.getElementById(id);
  const SOURCES = {
    simulated: "simulated presses, answered by the simulator", recorded: "a recording, at its rate",
    learned: "simulated presses, answered by the model's own learned map", streamed: "frames of a device, as they come",
    exported: "simulated presses: the model's learned map makes and reads them in this browser" };
  const ROWS = { x: ["x_mm", 1, 2], y: ["y_mm", 1, 2], d: ["d_mm", 1, 2], F: ["F_N", 3, 3],
                 depth: ["depth_mm", 2, 2], z: ["z_mm", 2, 2] };
  const SPOKEN_EVERY_MS = 1500, PLOTTED_EVERY_MS = 60, RATED_MS = 2000;
  let hello = null, shownSkin = null, hands = null, frame = null, frames = [], arrivals = [], missed = 0;
  let drawn = null, stale = true, unwritten = false, plotted = 0, spoken = 0;
  const latencies = [];

  const number = (value, digits) => value === undefined || value === null ? "–" : value.toFixed(digits);

  function greet(message) {
    const again = hello !== null;
    hello = message;
    frame = null;
    byId("source").textContent = SOURCES[hello.source];
    byId("counted").textContent = `${hello.unit || "as recorded"}, ${hello.readings} in order`;
    byId("assumes").textContent = hello.assumes && `read as ${hello.assumes}`;
    for (const [row, [key]] of Object.entries(ROWS))
      byId("read-" + row).closest("tr").hidden = !hello.values.includes(key);
    byId("force-plot").closest("figure").hidden = !hello.values.includes("F_N");
    byId("shown-field").hidden = hello.source !== "simulated";
    shownSkin = { hello, edge: edgeOf(hello.skin), picture: pictureOf(hello.skin) };
    byId("skin").style.setProperty("--aspect", shownSkin.picture.wide / shownSkin.picture.tall);
    byId("reach").hidden = !hello.limits || (hello.skin.circle_mm && hello.limits.gap_mm < 1);
    byId("reach").textContent = hello.skin.circle_mm ? "dotted: how far presses go" : "grey: " + NEAR_EDGE;
    document.body.classList.toggle("shown-only", !hello.limits);
    if (hello.limits && !again) hands = pressing(shownSkin, send);
  }

  function take(message) {
    if (frame && message.number === frame.number) return; // the last one, said again
    if (frame && message.number > frame.number + 1) missed += message.number - frame.number - 1;
    frame = message;
    frames.push(frame);
    arrivals.push(performance.now());
    if (hands && frame.answers_ms !== null) hands.take(frame.answers_ms);
    while (frames.length && frames[0].time_s < frame.time_s - HISTORY_S) frames.shift();
    while (arrivals.length && arrivals[0] < performance.now() - RATED_MS) arrivals.shift();
  }

  function lost() {
    byId("state").textContent = "the connection is closed; trying again. A command that was started again has another " +
      "address";
    still();
  }

  // No frames come.
  function still() {
    arrivals = [];
    byId("rate").value = "–";
  }

  function words() {
    const said = !frame.note || frame.read || (hello.source === "recorded" && frame.state !== "unreadable");
    const refused = hands ? hands.refusal() : "";
    return [said ? frame.state : "", frame.flag, frame.note, hands && hands.pulled(),
            refused && "not pressed: " + refused].filter(Boolean).join("; ");
  }

  function write() {
    for (const [row, [key, digits, finer]] of Object.entries(ROWS)) {
      byId("true-" + row).textContent = number(frame.true && frame.true[key], digits);
      byId("read-" + row).textContent = number(frame.read && frame.read[key], digits);
      byId("half-" + row).textContent = number(frame.half_width[key], finer);
    }
    if (latencies.length) byId("latency").value = Math.round(latencies[latencies.length - 1]);
    const state = words();
    if (byId("state").textContent !== state) byId("state").textContent = state;
    const between = arrivals.length > 1 ? arrivals[arrivals.length - 1] - arrivals[0] : 0;
    byId("rate").value = between ? Math.round(1000 * (arrivals.length - 1) / between) : "–";
    byId("caution").textContent = frame.caution;
    const field = byId("field").value, picture = frame.fields[field];
    const quantity = field === "strain" ? "strain" : "relative change of conductance";
    byId("shade").textContent = picture ? `${quantity}, at most ${picture.largest.toPrecision(2)}` : "";
    if (performance.now() - spoken > SPOKEN_EVERY_MS) {
      spoken = performance.now();
      const force = frame.read && "F_N" in frame.read ? `, force ${number(frame.read.F_N, 1)} newtons` : "";
      const said = frame.read ? `read x ${number(frame.read.x_mm, 0)}, y ${number(frame.read.y_mm, 0)} millimetres` +
        force : "no touch read";
      if (byId("spoken").textContent !== said) byId("spoken").textContent = said;
    }
  }

  function drawPlots() {
    const truth = name => f => f.true && f.true[name], read = name => f => f.read && f.read[name];
    drawLines(byId("force-plot"), frames, [{ value: truth("F_N"), colour: "pressed" },
                                           { value: read("F_N"), colour: "read" }], 0.5);
    drawLines(byId("place-plot"), frames, [
      { value: truth("x_mm"), colour: "pressed" }, { value: truth("y_mm"), colour: "pressed", dash: [4, 3] },
      { value: read("x_mm"), colour: "read" }, { value: read("y_mm"), colour: "read", dash: [4, 3] }], 10);
    drawBars(byId("bars"), frame.difference);
  }

  // The skin with every frame; numbers and plots, which nobody reads as fast, less often.
  function draw(now) {
    requestAnimationFrame(draw);
    if (!hello) return;
    if (arrivals.length && performance.now() - arrivals[arrivals.length - 1] > RATED_MS) still();
    const moved = hands ? hands.tick(now) : false;
    if (frame !== drawn || moved || stale) {
      drawSkin(byId("skin"), shownSkin, frame, hands && hands.cursor(), byId("field").value);
      for (const one of frames.filter(f => !f.seen)) {
        one.seen = true;
        if (one.answers_ms !== null) latencies.push(performance.now() - one.answers_ms);
      }
      if (latencies.length > 5000) latencies.splice(0, 1000);
      drawn = frame;
      stale = false;
      unwritten = true;
    }
    if (!frame || !unwritten || now - plotted < PLOTTED_EVERY_MS) return;
    unwritten = false;
    plotted = now;
    write();
    drawPlots();
  }

  const redraw = () => { stale = true; };
  addEventListener("resize", redraw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  const send = connect(greet, take, lost);
  window.shown = () => ({ frame, missed, latencies, skin: shownSkin, count: frame ? frame.number : 0 });
  requestAnimationFrame(draw);
})();
