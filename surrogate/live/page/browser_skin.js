"use strict";
// In place of a server: frames of the learned map under the latest controls, each read as it comes.

const FRAME_MS = 20, FORGETS = 0.05; // part of each untouched frame in the tracked one

function connect(onHello, onFrame) {
  const { hello, map: given } = JSON.parse(document.getElementById("learned").textContent);
  const map = learnedMap(given, edgeOf(hello.skin)), slope = Array.from({ length: map.readings }, normal);
  let controls = null, isNew = false, number = 0, state = null, before = performance.now();
  const start = before, drift = new Float64Array(map.readings), untouched = new Float64Array(map.readings);
  window.learned = map;

  function normal() {
    return Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random());
  }

  function frame() {
    const now = performance.now(), pressed = controls && controls.force_N > 0;
    const signal = pressed ? map.press(controls.x_mm, controls.y_mm, controls.diameter_mm, controls.force_N)
      : new Float64Array(map.readings);
    const noise_V = controls ? controls.noise_mV / 1e3 : 0, rate = controls ? controls.drift_mV_per_min / 6e7 : 0;
    for (let j = 0; j < signal.length; j++) {
      drift[j] += slope[j] * rate * (now - before);
      signal[j] += drift[j] + noise_V * normal() - untouched[j];
    }
    before = now;
    const found = map.read(signal, noise_V, state);
    state = found && found.state;
    if (!found) for (let j = 0; j < signal.length; j++) untouched[j] += FORGETS * signal[j];
    onFrame({
      number: ++number, time_s: (now - start) / 1e3, difference: Array.from(signal, v => 1e3 * v),
      true: !pressed ? null : { x_mm: controls.x_mm, y_mm: controls.y_mm, d_mm: controls.diameter_mm,
                                F_N: controls.force_N },
      read: found && found.read, half_width: found ? found.half_width : {}, ellipse: found && found.ellipse,
      state: found ? "touch" : "untouched", flag: found ? found.flag : "", caution: "", note: "", fields: {},
      answers_ms: isNew ? controls.sent_ms : null });
    isNew = false;
  }

  setTimeout(() => { onHello(hello); setInterval(frame, FRAME_MS); }, 0);
  return message => { controls = message; isNew = true; };
}
