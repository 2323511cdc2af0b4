"use strict";
// Pictures on canvases: the skin from above, lines over time, bars. Colours come from the style sheet.

const HISTORY_S = 10;

let known = null;
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { known = null; });

function colours() {
  if (known) return known;
  const style = getComputedStyle(document.documentElement);
  const named = {};
  for (const name of ["card", "ink", "soft", "line", "skin", "pressed", "read", "stretched", "squeezed"])
    named[name] = style.getPropertyValue("--" + name).trim();
  return known = named;
}

// The context of a canvas, cleared, in CSS pixels.
function cleared(canvas) {
  const box = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  const width = Math.round(box.width * ratio), height = Math.round(box.height * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, box.width, box.height);
  return { context, width: box.width, height: box.height };
}

function rgb(colour) { return [1, 3, 5].map(i => parseInt(colour.slice(i, i + 2), 16)).join(","); }

// A field about a punch, as opaque as it is strong.
function shaded(c, field, x, y, reach, colour) {
  const gradient = c.createRadialGradient(x, y, 0, x, y, reach);
  field.parts.forEach((part, k) => gradient.addColorStop(
    k / (field.parts.length - 1), `rgba(${rgb(part > 0 ? colour.stretched : colour.squeezed)},${Math.abs(part)})`));
  c.fillStyle = gradient;
  c.beginPath();
  c.arc(x, y, reach, 0, 2 * Math.PI);
  c.fill();
}

// The band along the edges in which no touch is known, and squares where two edges are too near.
function unknownBand(c, edge, view, gap_mm, colour) {
  c.save();
  c.beginPath(); edge.trace(c, view.X, view.Y, view.scale);
  c.clip("evenodd");
  c.strokeStyle = colour.soft; c.globalAlpha = 0.13; c.lineWidth = 2 * gap_mm * view.scale; c.lineJoin = "round";
  c.stroke();
  c.beginPath();
  const { side, cells } = edge.nearTwo(gap_mm);
  for (const [x, y] of cells)
    c.rect(view.X(x - side / 2), view.Y(y + side / 2), side * view.scale, side * view.scale);
  c.fillStyle = colour.soft; c.fill();
  c.restore();
}

function drawSkin(canvas, { hello, edge, picture }, frame, cursor, field) {
  const colour = colours(), { context: c, width, height } = cleared(canvas), view = viewOf(picture, width);
  const { X, Y, scale } = view, limits = hello.limits;
  const circle = (x, y, r) => { c.beginPath(); c.arc(X(x), Y(y), Math.max(r * scale, 0), 0, 2 * Math.PI); };
  const outline = () => { c.beginPath(); edge.trace(c, X, Y, scale); };
  outline();
  c.fillStyle = colour.skin; c.fill("evenodd");
  const fields = frame && frame.fields, truth = frame && frame.true;
  if (truth && fields && fields[field]) {
    c.save(); c.clip("evenodd");
    shaded(c, fields[field], X(truth.x_mm), Y(truth.y_mm), fields.reach_mm * scale, colour);
    c.restore();
  }
  c.strokeStyle = colour.line; c.lineWidth = 1;
  outline(); c.stroke();
  if (hello.skin.circle_mm) {
    const [x, y, radius] = hello.skin.circle_mm;
    for (const r of [0.25, 0.5, 0.75]) { circle(x, y, r * radius); c.globalAlpha = 0.5; c.stroke(); }
    c.globalAlpha = 1;
    if (limits && limits.gap_mm > 1) {
      c.setLineDash([2, 5]); c.strokeStyle = colour.soft; circle(x, y, radius - limits.gap_mm); c.stroke();
      c.setLineDash([]);
    }
  } else if (limits) unknownBand(c, edge, view, limits.gap_mm, colour);
  c.fillStyle = colour.soft; c.strokeStyle = colour.ink; c.lineWidth = 4;
  c.font = "11px system-ui, sans-serif"; c.textAlign = "center"; c.textBaseline = "middle";
  hello.skin.electrodes.forEach(({ along_mm: along, label_mm: label }, k) => {
    c.beginPath();
    along.forEach(([x, y], i) => { if (i) c.lineTo(X(x), Y(y)); else c.moveTo(X(x), Y(y)); });
    c.stroke();
    c.fillText(k, X(label[0]), Y(label[1]));
  });
  c.lineWidth = 1.5; c.strokeStyle = colour.soft;
  c.beginPath(); c.moveTo(8, height - 10); c.lineTo(8 + 20 * scale, height - 10); c.stroke();
  c.textAlign = "left";
  if (hello.skin.circle_mm) c.fillText("20 mm", 8, height - 20); else c.fillText("20 mm", 14 + 20 * scale, height - 10);
  if (cursor) {
    c.setLineDash([3, 3]); circle(cursor.x_mm, cursor.y_mm, cursor.diameter_mm / 2); c.stroke(); c.setLineDash([]);
  }
  if (truth) {
    c.strokeStyle = c.fillStyle = colour.pressed; c.lineWidth = 2.5;
    circle(truth.x_mm, truth.y_mm, truth.d_mm / 2); c.stroke();
    circle(truth.x_mm, truth.y_mm, 0.6); c.fill();
  }
  if (frame && frame.read) {
    const { x_mm, y_mm, d_mm } = frame.read;
    c.strokeStyle = colour.read; c.lineWidth = 2;
    if (d_mm) { c.setLineDash([6, 4]); circle(x_mm, y_mm, d_mm / 2); c.stroke(); c.setLineDash([]); }
    const e = frame.ellipse;
    if (e) {
      c.beginPath();
      c.ellipse(X(x_mm), Y(y_mm), e.long_mm * scale, e.short_mm * scale, -e.angle_rad, 0, 2 * Math.PI); c.stroke();
    }
    c.beginPath();
    c.moveTo(X(x_mm) - 6, Y(y_mm)); c.lineTo(X(x_mm) + 6, Y(y_mm));
    c.moveTo(X(x_mm), Y(y_mm) - 6); c.lineTo(X(x_mm), Y(y_mm) + 6); c.stroke();
  }
}

// Lines over the last HISTORY_S; a series is {value(frame) -> number or null, colour, dash}.
function drawLines(canvas, frames, series, least) {
  const colour = colours(), { context: c, width, height } = cleared(canvas);
  if (!frames.length) return;
  const end = frames[frames.length - 1].time_s;
  const values = frames.flatMap(f => series.map(s => s.value(f)).filter(v => v !== null && v !== undefined));
  const low = Math.min(0, ...values), high = Math.max(least, ...values), left = 40;
  const X = t => left + (width - left - 4) * (1 - (end - t) / HISTORY_S);
  const Y = v => height - 8 - (height - 16) * (v - low) / (high - low);
  c.font = "11px system-ui, sans-serif"; c.fillStyle = colour.soft; c.textAlign = "right"; c.textBaseline = "middle";
  for (const v of new Set([low, 0, high])) {
    const legible = v !== 0 || low === 0 || (Y(low) - Y(0) > 12 && Y(0) - Y(high) > 12);
    if (legible) c.fillText(+v.toPrecision(2), left - 5, Y(v));
    c.strokeStyle = colour.line; c.lineWidth = 1;
    c.beginPath(); c.moveTo(left, Y(v)); c.lineTo(width - 4, Y(v)); c.stroke();
  }
  for (const one of series) {
    c.strokeStyle = colour[one.colour]; c.lineWidth = one.colour === "pressed" ? 3.5 : 1.5;
    c.setLineDash(one.dash || []);
    c.beginPath();
    let on = false;
    for (const f of frames) {
      const v = one.value(f);
      if (v === null || v === undefined) { on = false; continue; }
      if (!on) c.moveTo(X(f.time_s) - 2, Y(v));  // a lone frame is a dash
      c.lineTo(X(f.time_s), Y(v));
      on = true;
    }
    c.stroke();
  }
  c.setLineDash([]);
}

function drawBars(canvas, values) {
  const colour = colours(), { context: c, width, height } = cleared(canvas);
  if (!values.some(v => v)) return;
  const largest = Math.max(1e-3, ...values.map(v => Math.abs(v || 0))), left = 40, middle = height / 2;
  const step = (width - left - 4) / values.length;
  c.fillStyle = colour.ink;
  values.forEach((v, k) => {
    const tall = (middle - 6) * (v || 0) / largest;
    c.fillRect(left + k * step, middle - Math.max(tall, 0), Math.max(step * 0.8, 0.6), Math.abs(tall));
  });
  c.fillStyle = colour.soft; c.font = "11px system-ui, sans-serif"; c.textAlign = "right"; c.textBaseline = "middle";
  const label = +largest.toPrecision(2);
  c.fillText(label, left - 5, 8); c.fillText("−" + label, left - 5, height - 8);
  c.fillRect(left, middle, width - left - 4, 1);
}
