"use strict";
// The skin from above: its edges, a circle or closed polygons, how far places are from them, and where it is pressed.

const SLACK_MM = 1e-3; // rounding of places and edges that a press is not refused for
const NEAR_EDGE = "nearer to an edge than the model knows", NEAR_TWO = "nearer to two edges than the model knows";
const SQUARES = 240; // squares along the longer side of a skin, where it is drawn what is not known
const OFF_SKIN = "the punch does not lie on the skin";

// A disc: presses outside the allowed radius are pulled onto it, so that none is refused.
function circleEdge([x0, y0, radius]) {
  return {
    trace: (c, X, Y, scale) => c.arc(X(x0), Y(y0), radius * scale, 0, 2 * Math.PI),
    held: ([x, y], gap) => {
      const far = Math.hypot(x - x0, y - y0), pull = far > radius - gap ? (radius - gap) / far : 1;
      return [x0 + (x - x0) * pull, y0 + (y - y0) * pull];
    },
    refusal: () => "" };
}

// An outer edge and holes: presses are refused where no touch is known.
function polygonEdge({ loops_mm: loops, box_mm: [left, low, right, high], alone_mm: alone, on_line: onLine }) {
  const sides = loops.flatMap(loop => loop.map((a, k) => [...a, ...loop[(k + 1) % loop.length]]));
  const clip = (v, a, b) => Math.min(Math.max(v, a), b);

  // Distance to the nearest edge, negative off the skin, and its slope.
  function distance([x, y]) {
    let least = Infinity, offX = 0, offY = 0, within = false, nearest = null;
    for (const side of sides) {
      const [ax, ay, bx, by] = side;
      const tx = bx - ax, ty = by - ay, way = clip(((x - ax) * tx + (y - ay) * ty) / (tx * tx + ty * ty), 0, 1);
      const dx = x - ax - way * tx, dy = y - ay - way * ty, square = dx * dx + dy * dy;
      if (square < least) { least = square; offX = dx; offY = dy; nearest = side; }
      if ((ay > y) !== (by > y) && x < ax + (y - ay) * tx / ty) within = !within;
    }
    const away = Math.sqrt(least), sign = within ? 1 : -1, over = sign / Math.max(away, 1e-12);
    return { away: sign * away, slope: [over * offX, over * offY], nearest };
  }

  // Whether all edges within reach lie on the line of this one.
  function byOneEdge([x, y], [ax, ay, bx, by]) {
    const long = Math.hypot(bx - ax, by - ay), nx = (by - ay) / long, ny = (ax - bx) / long;
    const off = (px, py) => Math.abs((px - ax) * nx + (py - ay) * ny);
    return sides.every(([px, py, qx, qy]) => {
      if (Math.max(off(px, py), off(qx, qy)) <= onLine * alone) return true;
      const tx = qx - px, ty = qy - py, way = clip(((x - px) * tx + (y - py) * ty) / (tx * tx + ty * ty), 0, 1);
      return Math.hypot(x - px - way * tx, y - py - way * ty) > alone;
    });
  }

  function refusal(place, diameter, gap) {
    const { away, nearest } = distance(place);
    if (away < gap - SLACK_MM || away < diameter / 2 - SLACK_MM)
      return away < diameter / 2 - SLACK_MM ? OFF_SKIN : NEAR_EDGE;
    return away < alone - SLACK_MM && !byOneEdge(place, nearest) ? NEAR_TWO : "";
  }

  // Middles of squares of the skin where two edges are too near; the last ones are kept, since a skin is drawn often.
  let last = { gap: NaN };
  function nearTwo(gap) {
    if (gap !== last.gap) {
      const side = Math.max(right - left, high - low) / SQUARES, cells = [];
      for (let x = left + side / 2; alone > gap && x < right; x += side)
        for (let y = low + side / 2; y < high; y += side)
          if (refusal([x, y], 0, gap) === NEAR_TWO) cells.push([x, y]);
      last = { gap, side, cells };
    }
    return last;
  }

  return {
    distance, refusal, nearTwo,
    trace: (c, X, Y) => {
      for (const loop of loops) {
        loop.forEach(([x, y], k) => { if (k) c.lineTo(X(x), Y(y)); else c.moveTo(X(x), Y(y)); });
        c.closePath();
      }
    },
    held: ([x, y]) => [clip(x, left, right), clip(y, low, high)] };
}

// Edges as `hello` states them.
function edgeOf(skin) { return skin.circle_mm ? circleEdge(skin.circle_mm) : polygonEdge(skin); }

// Sizes of the picture of a skin, mm, electrodes and their numbers around it; a disc leaves its corners for the scale,
// other skins a strip below.
function pictureOf({ box_mm: [left, low, right, high], circle_mm: circle }) {
  const wide = right - left, tall = high - low, border = 0.065 * Math.max(wide, tall);
  return { wide: wide + 2 * border, tall: tall + 2 * border + (circle ? 0 : 0.7 * border),
           middle: [(left + right) / 2, (low + high) / 2], top: tall / 2 + border };
}

// From mm to pixels of a picture so many pixels wide.
function viewOf(picture, pixels) {
  const scale = pixels / picture.wide, [x0, y0] = picture.middle, down = picture.top * scale;
  return { scale, X: x => pixels / 2 + (x - x0) * scale, Y: y => down - (y - y0) * scale,
           place: (right, below) => [x0 + (right - pixels / 2) / scale, y0 + (down - below) / scale] };
}
