"use strict";
// What is done with mouse, finger, wheel and keys becomes the controls that a skin is sent.

const MOVE_MM = 1, FAR_MM = 5, FORCE_STEP_N = 0.05, GROWS_IN_S = 4, SENT_EVERY_MS = 12, PULLED_MM = 1;
// A force grows by a hundredth of its most meanwhile; it is sent once the press before is answered, so that none queues,
// or after the longer time.
const GROWTH_SENT_EVERY_MS = 40, UNANSWERED_MS = 500;

function pressing({ hello, edge, picture }, send) {
  const byId = id => document.getElementById(id), canvas = byId("skin"), limits = hello.limits;
  const place = { x_mm: limits.start_mm[0], y_mm: limits.start_mm[1] };
  let off_mm = 0; // from where was pressed to the place
  let moved = true, down = false, held = false, grown = 0, last = performance.now(), sent = 0, answered = 0, waits = false;
  let grew = false;

  byId("force").max = Math.floor(limits.force_N / FORCE_STEP_N) * FORCE_STEP_N;
  byId("force").value = limits.force_N / 4;
  byId("noise").max = limits.noise_mV;
  byId("noise").step = "any"; // a step would round the noise to begin with
  byId("drift").step = limits.noise_mV / 100;
  byId("noise").value = hello.noise_mV;
  byId("drift").max = limits.drift_mV_per_min;
  byId("drift").value = 0;
  for (const d of limits.diameters_mm) byId("diameter").add(new Option(d, d));
  byId("diameter").selectedIndex = Math.floor(limits.diameters_mm.length / 2);

  function force() { return Math.min(Number(byId("force").value) + grown, limits.force_N); }

  function sayNoise() { byId("noise-now").value = Number(Number(byId("noise").value).toPrecision(3)); }

  function cursor() { return { ...place, diameter_mm: Number(byId("diameter").value) }; }

  // Why what is pressed is not pressed, if anything is.
  function refusal() {
    return down ? edge.refusal([place.x_mm, place.y_mm], cursor().diameter_mm, limits.gap_mm) : "";
  }

  function changed() {
    moved = true;
    const set = Number(byId("force").value).toFixed(2), now_N = force().toFixed(2);
    byId("force-now").value = now_N === set ? set : `${set} → ${now_N}`;
    sayNoise();
    byId("drift-now").value = Number(byId("drift").value).toFixed(2);
    const now = performance.now();
    waits = now - sent < SENT_EVERY_MS;
    if (waits) return;
    sent = now;
    grew = false;
    send({ ...cursor(), force_N: down && !refusal() ? force() : 0, noise_mV: Number(byId("noise").value),
           drift_mV_per_min: Number(byId("drift").value), sent_ms: now });
  }

  function moveTo(x, y) {
    [place.x_mm, place.y_mm] = edge.held([x, y], limits.gap_mm);
    off_mm = Math.hypot(place.x_mm - x, place.y_mm - y);
  }

  // Why what is pressed lies elsewhere than was pointed at, if it does.
  function pulled() {
    const drawn = hello.skin.circle_mm && limits.gap_mm > 1;
    return down && drawn && off_mm > PULLED_MM ? "moved onto the dotted circle: presses go no farther" : "";
  }

  function pointed(event) {
    const box = canvas.getBoundingClientRect(), view = viewOf(picture, box.width);
    moveTo(...view.place(event.clientX - box.left, event.clientY - box.top));
  }

  function lift() { down = held = false; grown = 0; changed(); }

  canvas.addEventListener("pointerdown", event => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    pointed(event);
    down = held = true;
    grown = 0;
    changed();
  });
  canvas.addEventListener("pointermove", event => { if (held) { pointed(event); changed(); } });
  canvas.addEventListener("pointerup", () => { if (held) lift(); });
  canvas.addEventListener("pointercancel", () => { if (held) lift(); });

  function forceBy(step) { byId("force").value = Number(byId("force").value) + step; changed(); }

  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    forceBy(event.deltaY < 0 ? FORCE_STEP_N : -FORCE_STEP_N);
  }, { passive: false });

  const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  canvas.addEventListener("keydown", event => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const step = event.shiftKey ? FAR_MM : MOVE_MM;
    if (moves[event.key]) {
      const [right, up] = moves[event.key];
      moveTo(place.x_mm + right * step, place.y_mm + up * step);
      changed();
    } else if (event.key === "+" || event.key === "=") forceBy(FORCE_STEP_N);
    else if (event.key === "-" || event.key === "−") forceBy(-FORCE_STEP_N);
    else if (event.key === " ") { if (down) lift(); else { down = true; changed(); } }
    else return;
    event.preventDefault();
  });

  for (const id of ["force", "diameter", "drift"]) byId(id).addEventListener("input", changed);
  byId("noise").addEventListener("input", sayNoise);
  byId("noise").addEventListener("change", changed);

  // Once a picture: forces that grow, and what came too soon after the last message; whether anything changed.
  function tick(now) {
    const growing = held && byId("grow").checked && force() < limits.force_N;
    if (growing) grown += (now - last) / 1e3 * limits.force_N / GROWS_IN_S;
    grew = grew || growing;
    const due = now - sent > (answered < sent ? UNANSWERED_MS : GROWTH_SENT_EVERY_MS);
    if (waits || grew && (!growing || due)) changed();
    last = now;
    const was = moved;
    moved = false;
    return was;
  }

  // The press that was sent at this time is answered.
  function take(sent_ms) { answered = sent_ms; }

  changed();
  return { cursor, refusal, pulled, tick, take };
}
