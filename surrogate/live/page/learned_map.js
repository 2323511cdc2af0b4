"use strict";
// The learned map from a touch (x, y, log d, g) to its signal, and its inversion by Levenberg-Marquardt: the same sums
// as surrogate/forward_map in the program that wrote this page, by one touch at a time, on a skin of these edges.

function learnedMap(given, edge) {
  const unpack = one => {
    const bytes = Uint8Array.from(atob(one.base64), c => c.charCodeAt(0));
    return Float64Array.from(one.kind === "<f4" ? new Float32Array(bytes.buffer) : new Float64Array(bytes.buffer));
  };
  const ring = given.ring, angle = unpack(ring.angle_rad), electrodes = angle.length, readings = ring.read.length;
  const sheet = given.sheet && { pole: unpack(given.sheet.pole), strength: unpack(given.sheet.strength) };
  const field = unpack(given.field), orders = given.orders, rim = given.rim;
  const size = { centre: unpack(given.size.centre), weights: unpack(given.size.weights) };
  const contact = given.contacts && { ...given.contacts, along: given.contacts.directions.map(unpack) };
  const processes = given.strengths.map(s => Object.fromEntries(Object.entries(s).map(([k, v]) => [k, unpack(v)])));
  const answer = rim && Object.fromEntries(Object.entries(rim.answer).map(([k, v]) => [k, unpack(v)]));
  const metal = rim && rim.metal && { ...rim.metal, nodes: unpack(rim.metal.nodes), lengths: unpack(rim.metal.lengths),
                         weights: unpack(rim.metal.weights), directions: unpack(rim.metal.directions) };

  // Coefficient of z^s in the n-th derivative of an electrode's field on a disc.
  const coefficients = Array.from({ length: sheet ? 0 : orders }, (_, k) => {
    const n = k + 1, out = new Float64Array(field.length - n + 1);
    for (let s = 0; s < out.length; s++) {
      let falling = 1;
      for (let i = 1; i < n; i++) falling *= s + n - i;
      out[s] = field[s + n - 1] * falling;
    }
    return out;
  });

  // Derivatives of the electrodes' fields at z, real and imaginary parts [order][electrode]: of a disc by their series.
  function seriesAt(zx, zy) {
    const real = [], imaginary = [];
    for (let k = 0; k < orders; k++) {
      real.push(new Float64Array(electrodes));
      imaginary.push(new Float64Array(electrodes));
    }
    for (let e = 0; e < electrodes; e++) {
      const ct = Math.cos(angle[e]), st = -Math.sin(angle[e]), wx = zx * ct - zy * st, wy = zx * st + zy * ct;
      let tx = 1, ty = 0;
      for (let k = 0; k < orders; k++) {
        const c = coefficients[k];
        let a = 0, b = 0;
        for (let s = c.length - 1; s >= 0; s--) { const t = a * wx - b * wy + c[s]; b = a * wy + b * wx; a = t; }
        [tx, ty] = [tx * ct - ty * st, tx * st + ty * ct];
        real[k][e] = a * tx - b * ty;
        imaginary[k][e] = a * ty + b * tx;
      }
    }
    return { real, imaginary };
  }

  // Of a skin with an outline by their poles w on the edges: k! sum_w strength / (w - z)^(k + 1).
  function polesAt(zx, zy) {
    const real = Array.from({ length: orders }, () => new Float64Array(electrodes));
    const imaginary = Array.from({ length: orders }, () => new Float64Array(electrodes)), { pole, strength } = sheet;
    for (let p = 0; p < pole.length / 2; p++) {
      const wx = pole[2 * p] - zx, wy = pole[2 * p + 1] - zy, square = wx * wx + wy * wy;
      const kx = wx / square, ky = -wy / square;
      let a = 1, b = 0;
      for (let k = 0; k < orders; k++) {
        const by = k || 1, re = real[k], im = imaginary[k];
        [a, b] = [by * (a * kx - b * ky), by * (a * ky + b * kx)];
        for (let e = 0, at = 2 * p * electrodes; e < electrodes; e++, at += 2) {
          re[e] += a * strength[at] - b * strength[at + 1];
          im[e] += a * strength[at + 1] + b * strength[at];
        }
      }
    }
    return { real, imaginary };
  }

  const scaledPlace = (x, y) => [(x - ring.origin_mm[0]) / ring.radius_mm, (y - ring.origin_mm[1]) / ring.radius_mm];

  // How near a place is to the edge: |z| on a disc, else 1 less the distance over the largest one.
  const radial = (x, y) => sheet ? 1 - edge.distance([x, y]).away / ring.radius_mm : Math.hypot(...scaledPlace(x, y));

  let last = { x: NaN, y: NaN };

  // Fields at a place, mm; those of the last one are kept, since touches at one place follow each other.
  function fieldsAt(x, y) {
    if (x !== last.x || y !== last.y)
      last = { x, y, f: (sheet ? polesAt : seriesAt)(...scaledPlace(x, y)) };
    return last.f;
  }

  function share(radius, zone) {
    const t = Math.min(Math.max((radius - zone[0]) / (zone[1] - zone[0]), 0), 1);
    return t * t * (3 - 2 * t);
  }

  // The series' basis [order][reading].
  function basisOf(f, radius) {
    const high = given.high_end ? 1 - share(radius, given.high_end) : 1, out = [];
    for (let k = 0; k < orders; k++) {
      const a = f.real[k], b = f.imaginary[k], column = new Float64Array(readings);
      const part = k < given.kept_orders ? 1 : high;
      for (let j = 0; j < readings; j++) {
        const s = ring.source[j], i = ring.sink[j], r = ring.read[j], g = ring.ground[j];
        column[j] = part * ((a[s] - a[i]) * (a[r] - a[g]) + (b[s] - b[i]) * (b[r] - b[g]));
      }
      out.push(column);
    }
    return out;
  }

  function processMean(process, x) {
    const q = x.length, u = x.map((v, i) => v - process.centre[i]), { nodes, lengths, weights, trend } = process;
    let mean = trend[0];
    for (let i = 0; i < q; i++) mean += trend[1 + i] * u[i];
    for (let k = 0; k < weights.length; k++) {
      let square = 0;
      for (let i = 0; i < q; i++) { const d = u[i] / lengths[i] - nodes[k * q + i]; square += d * d; }
      mean += weights[k] * Math.exp(-square / 2);
    }
    return mean;
  }

  // Positive size of the strengths over the force.
  function sizeAt(x) {
    const q = x.length, u = x.map((v, i) => v - size.centre[i]), w = size.weights;
    let log = w[0];
    for (let i = 0; i < q; i++) log += w[1 + i] * u[i];
    return Math.exp(log + w[1 + q] * u[0] * u[0] + w[2 + q] * u[0] * u[1] + w[3 + q] * u[1] * u[1]);
  }

  const inputs = processes[0].centre.length;
  const force = (logD, g) => given.p0 * Math.sinh(g) * Math.exp(2 * logD);
  const norm = values => Math.sqrt(values.reduce((sum, v) => sum + v * v, 0));

  // Signal, basis, and size of the strengths at a touch; `shape` is the size as a signal's norm, V.
  function at(u) {
    const [x, y, logD, g] = u, radius = radial(x, y);
    const f = fieldsAt(x, y), basis = basisOf(f, radius);
    const input = new Array(inputs).fill(0);
    input[0] = logD; input[1] = g; input[2] = Math.min(radius, given.interior) ** 2;
    const strength = sizeAt(input) * force(logD, g), signal = new Float64Array(readings), dipole = norm(basis[0]);
    if (rim && rim.replaces) {
      const kept = 1 - share(radius, given.zone);
      for (const column of basis) for (let j = 0; j < readings; j++) column[j] *= kept;
    }
    processes.forEach((process, k) => {
      const p = strength * processMean(process, input), column = basis[k];
      for (let j = 0; j < readings; j++) signal[j] += p * column[j];
    });
    if (rim && radius > given.zone[0]) addRim(signal, f, [x, y], radius, logD, g, strength, dipole);
    return { signal, basis, strength, shape: strength * dipole, radius, half: Math.exp(logD) / 2 / ring.radius_mm };
  }

  // The direction towards the nearest edge.
  function outwards(at, radius) {
    return sheet ? edge.distance(at).slope.map(v => -v) : scaledPlace(...at).map(v => v / radius);
  }

  function addRim(signal, f, at, radius, logD, g, strength, dipole) {
    const half = Math.exp(logD) / 2 / ring.radius_mm, gap = 1 - radius - half;
    const felt = Math.log(rim.answer_soft + Math.max(gap, 0)), side = rim.step !== null && gap < rim.step ? 1 : 0;
    const counts = strength * share(radius, given.zone);
    addAnswer(signal, f, outwards(at, radius), half, [logD, g, felt, side], counts);
    if (metal) addMetal(signal, ...scaledPlace(...at), radius, [logD, g, felt, side], counts * dipole);
  }

  // The skin's answer: a bilinear form in the fields' Taylor series about the punch.
  function addAnswer(signal, f, [ux, uy], half, x, counts) {
    const n = rim.answer_orders, pairs = n * (n + 1), q = x.length, { nodes, centre, lengths, weights } = answer;
    if (!nodes.length) return;
    const u = x.map((v, i) => (v - centre[i]) / lengths[i]), c = new Float64Array(pairs);
    for (let j = 0; j < pairs; j++) {
      c[j] = weights[j];
      for (let i = 0; i < q; i++) c[j] += u[i] * weights[(1 + i) * pairs + j];
    }
    for (let k = 0; k < nodes.length / q; k++) {
      let square = 0;
      for (let i = 0; i < q; i++) square += (u[i] - nodes[k * q + i]) ** 2;
      const near = Math.exp(-square / 2), from = (1 + q + k) * pairs;
      for (let j = 0; j < pairs; j++) c[j] += near * weights[from + j];
    }
    const form = Array.from({ length: 2 * n }, () => new Float64Array(2 * n));
    let pair = 0;
    for (let i = 0; i < n; i++) for (let j = i; j < n; j++, pair++) for (const part of [0, 1]) {
      form[i + part * n][j + part * n] += c[2 * pair + part] / 2;
      form[j + part * n][i + part * n] += c[2 * pair + part] / 2;
    }
    const series = Array.from({ length: electrodes }, () => new Float64Array(2 * n));
    let tx = 1, ty = 0;
    for (let k = 0; k < n; k++) {
      [tx, ty] = [(tx * ux - ty * uy) * half / (k + 1), (tx * uy + ty * ux) * half / (k + 1)];
      for (let e = 0; e < electrodes; e++) {
        series[e][k] = f.real[k][e] * ty + f.imaginary[k][e] * tx;
        series[e][n + k] = f.real[k][e] * tx - f.imaginary[k][e] * ty;
      }
    }
    const scale = counts / half ** 2;
    for (let j = 0; j < readings; j++) {
      const s = series[ring.source[j]], i = series[ring.sink[j]], r = series[ring.read[j]], g = series[ring.ground[j]];
      let sum = 0;
      for (let a = 0; a < 2 * n; a++) for (let b = 0; b < 2 * n; b++)
        sum += (s[a] - i[a]) * form[a][b] * (r[b] - g[b]);
      signal[j] += scale * sum;
    }
  }

  // What the electrodes' metal adds, learned in one half-sector.
  function addMetal(signal, zx, zy, radius, [logD, g, felt, side], counts) {
    let chosen = 0, least = Infinity;
    metal.turn.forEach(([tx, ty], k) => {
      const y = metal.mirrored[k] ? -zy : zy;
      let turned = Math.atan2(tx * y + ty * zx, tx * zx - ty * y);
      if (turned < -1e-12) turned += 2 * Math.PI;
      if (turned < least) { least = turned; chosen = k; }
    });
    const sector = least > Math.PI ? least - 2 * Math.PI : least;
    const x = [logD, g, Math.log(rim.metal_soft - radius), rim.along * sector * radius, felt, side];
    const q = x.length, parts = metal.components, { nodes, lengths, weights, directions } = metal;
    const u = x.map((v, i) => v / lengths[i]), mean = new Float64Array(parts);
    for (let k = 0; k < nodes.length / q; k++) {
      let square = 0;
      for (let i = 0; i < q; i++) { const d = u[i] - nodes[k * q + i]; square += d * d; }
      const root = Math.sqrt(5 * square), near = (1 + root + root * root / 3) * Math.exp(-root);
      for (let j = 0; j < parts; j++) mean[j] += near * weights[k * parts + j];
    }
    for (let r = 0; r < readings; r++) {
      const from = (chosen * readings + r) * parts;
      let sum = 0;
      for (let j = 0; j < parts; j++) sum += directions[from + j] * mean[j];
      signal[r] += counts * sum;
    }
  }

  // Linear between points, as numpy.interp.
  function interpolated(x, xs, ys) {
    if (x <= xs[0]) return ys[0];
    for (let k = 1; k < xs.length; k++)
      if (x <= xs[k]) return ys[k - 1] + (ys[k] - ys[k - 1]) * (x - xs[k - 1]) / (xs[k] - xs[k - 1]);
    return ys[xs.length - 1];
  }

  // Standard deviation of one reading: noise and the map's own error.
  function spread(here, g, noise_V) {
    let floor = given.floor;
    if (rim && here.radius > given.zone[0]) {
      const gap = 1 - here.radius - here.half, { gap: gaps, load, error } = rim.error;
      const column = (table, k) => interpolated(gap, gaps, table.map(row => row[k]));
      const at = [0, 1, 2].map(k => column(load, k)), size = [0, 1, 2].map(k => column(error, k));
      floor = Math.max(floor, interpolated(g, at, size) / Math.sqrt(rim.shared));
    }
    return Math.hypot(noise_V, floor * Math.sqrt(ring.copies) * here.shape, 1e-15);
  }

  // A place pulled back to the training touches and a margin about them.
  function onDisc(x, y) {
    const limit = Math.min(given.bounds[1][0] + given.margin_mm, given.most_radius * ring.radius_mm);
    const far = Math.hypot(x, y), pull = far > limit ? limit / far : 1;
    return [x * pull, y * pull];
  }

  // The same on a skin with an outline: at right angles to the nearest edge; where two edges are in each other's way
  // the nearest of the candidates.
  function fromEdges(x, y) {
    const { least_mm: least, back } = given.sheet, start = [x, y];
    let at = start;
    for (let k = 0; k < back; k++) {
      const { away, slope } = edge.distance(at), by = Math.max(least - away, 0);
      if (by) at = [at[0] + by * slope[0], at[1] + by * slope[1]];
    }
    if (edge.distance(at).away >= 0.999 * least) return at;
    candidates = candidates || planes();
    const far = c => Math.hypot(c.x - start[0], c.y - start[1]);
    const best = candidates.reduce((one, other) => far(other) < far(one) ? other : one);
    return [best.x, best.y];
  }

  function held(u) {
    const [x, y, logD, g] = u, [low, high] = given.bounds;
    const clip = (v, a, b) => Math.min(Math.max(v, a), b);
    const log = clip(logD, Math.log(low[1]) - given.margin, Math.log(high[1]) + given.margin);
    const area = Math.exp(2 * log) * given.p0;
    return [...(sheet ? fromEdges : onDisc)(x, y), log, clip(g, Math.asinh(low[2] * Math.exp(-given.margin) / area),
                                                             Math.asinh(high[2] * Math.exp(given.margin) / area))];
  }

  const states = 4 + orders, toUnknown = s => held(given.mean.map((m, i) => m + given.sd[i] * s[i]));
  const scaled = u => u.map((v, i) => (v - given.mean[i]) / given.sd[i]);

  // Cost, and with `slopes` gradient and normal matrix, of a state: four scaled unknowns, then errors of the strengths.
  function costOf(signal, state, sd, slopes) {
    const u = toUnknown(state), here = at(u), residual = new Float64Array(readings);
    for (let j = 0; j < readings; j++) residual[j] = here.signal[j] - signal[j];
    const columns = [];
    for (let k = 0; k < orders; k++) {
      const by = here.strength * given.strength_sd[k];
      columns.push(here.basis[k].map(v => v * by));
      for (let j = 0; j < readings; j++) residual[j] += columns[k][j] * state[4 + k];
    }
    let misfit = 0, prior = 0;
    for (let j = 0; j < readings; j++) misfit += (residual[j] / sd) ** 2;
    for (const s of state) prior += s * s;
    const found = { cost: misfit + prior, misfit: misfit / (readings - states), u, here };
    if (!slopes) return found;
    const touch = [0, 1, 2, 3].map(i => {
      const step = 1e-4, moved = u.slice();
      moved[i] += step * given.sd[i];
      const there = at(moved).signal;
      return there.map((v, j) => (v - here.signal[j]) / step);
    });
    const jacobian = [...touch, ...columns];
    Object.assign(found, { residual, jacobian });
    found.normal = jacobian.map((a, i) => jacobian.map((b, k) => {
      let sum = i === k ? 1 : 0;
      for (let j = 0; j < readings; j++) sum += a[j] * b[j] / (sd * sd);
      return sum;
    }));
    found.gradient = jacobian.map((a, i) => {
      let sum = state[i];
      for (let j = 0; j < readings; j++) sum += a[j] * residual[j] / (sd * sd);
      return sum;
    });
    return found;
  }

  // Solution of a symmetric positive system with several right sides, by Gauss-Jordan.
  function solved(matrix, right) {
    const n = matrix.length, rows = matrix.map((row, i) => [...row, ...right[i]]);
    for (let i = 0; i < n; i++) {
      let pivot = i;
      for (let k = i + 1; k < n; k++) if (Math.abs(rows[k][i]) > Math.abs(rows[pivot][i])) pivot = k;
      [rows[i], rows[pivot]] = [rows[pivot], rows[i]];
      for (let k = 0; k < n; k++) {
        if (k === i) continue;
        const by = rows[k][i] / rows[i][i];
        for (let j = i; j < rows[k].length; j++) rows[k][j] -= by * rows[i][j];
      }
    }
    return rows.map((row, i) => row.slice(n).map(v => v / row[i]));
  }

  function descend(signal, start, noise_V, steps) {
    let state = start.slice(), damping = 1e-3, u = toUnknown(state);
    const sd = spread(at(u), u[3], noise_V);
    let here = costOf(signal, state, sd, true);
    for (let step = 0; step < steps && damping < 1e6; step++) {
      const damped = here.normal.map((row, i) => row.map((v, j) => v * (i === j ? 1 + damping : 1)));
      const move = solved(damped, here.gradient.map(v => [v])).map(row => row[0]);
      const moved = state.map((v, i) => v - move[i]);
      moved.splice(0, 4, ...scaled(toUnknown(moved)));
      const there = costOf(signal, moved, sd, false);
      if (!(there.cost < here.cost)) { damping = Math.max(damping * 10, 1e-3); continue; }
      const small = here.cost - there.cost < 1e-7 * (1 + there.cost);
      state = moved;
      here = costOf(signal, state, sd, true);
      damping /= 10;
      if (small) break;
    }
    return { ...here, state, sd, noisy: noise_V > 1e-15 };
  }

  // Orthonormal signals of the first two orders at candidate places, made when first needed.
  let candidates = null;
  function planes() {
    const places = unpack(given.candidates), out = [];
    for (let k = 0; k < places.length / 2; k++) {
      const [a, b] = basisOf(fieldsAt(places[2 * k], places[2 * k + 1]), 0), first = norm(a);
      const one = a.map(v => v / first), along = b.reduce((sum, v, j) => sum + v * one[j], 0);
      const rest = b.map((v, j) => v - along * one[j]), second = norm(rest);
      out.push({ x: places[2 * k], y: places[2 * k + 1], one, two: rest.map(v => v / second) });
    }
    return out;
  }

  // Starts: the best places of the first orders, at several loads.
  function starts(signal) {
    candidates = candidates || planes();
    const match = candidates.map(c => {
      let a = 0, b = 0;
      for (let j = 0; j < readings; j++) { a += signal[j] * c.one[j]; b += signal[j] * c.two[j]; }
      return { c, worth: a * a + b * b };
    }).sort((p, q) => q.worth - p.worth).slice(0, 2);
    const [low, high] = [-1.3, 1.3];
    return match.flatMap(({ c }) => [0, 1, 2, 3].map(k => {
      const s = scaled([c.x, c.y, given.mean[2], given.mean[3] + given.sd[3] * (low + (high - low) * k / 3)]);
      return [...s, ...new Array(orders).fill(0)];
    }));
  }

  // The most probable touch of a signal, from the last state where one is given and explains it.
  function read(signal, noise_V, before) {
    // no touch: weaker than any trained one, or than five standard deviations of what noise adds up to
    const noisy = noise_V * Math.sqrt(readings + 5 * Math.sqrt(2 * readings));
    if (norm(signal) < Math.max(given.weakest_V, noisy)) return null;
    let found = before ? descend(signal, before, noise_V, 12) : null;
    if (!found || found.misfit > given.misfit) {
      const short = starts(signal).map(s => descend(signal, s, noise_V, 6)).sort((a, b) => a.cost - b.cost);
      const long = short.slice(0, 2).map(s => descend(signal, s.state, noise_V, 60)).sort((a, b) => a.cost - b.cost);
      if (!found || long[0].cost < found.cost) found = long[0];
    }
    return described(found);
  }

  // What a contact that changed, or none, shifts of a state and adds to its covariance: as changed_contacts.moved.
  function byContacts({ residual, jacobian, normal, sd }) {
    const dot = (a, b) => a.reduce((sum, v, j) => sum + v * b[j], 0), changes = contact.along;
    const across = jacobian.map(column => changes.map(one => dot(column, one) / sd)), gain = solved(normal, across);
    const each = changes.map((one, k) => {
      const by = gain.map(row => row[k]), left = 1 - across.reduce((sum, row, p) => sum + row[k] * by[p], 0);
      const size = -dot(one, residual) / sd / left, wide = 1 + contact.changed ** 2 * left, part = 1 - 1 / wide;
      const odds = Math.exp(size * size * left * part / 2) / Math.sqrt(wide) / changes.length;
      return { by, odds, size: size * part, own: contact.changed ** 2 / wide, is: Math.abs(size) < contact.most };
    });
    const all = each.reduce((sum, { odds }) => sum + odds, 1);
    const weighed = each.filter(({ is }) => is).map(one => ({ ...one, weight: one.odds / all }));
    const shift = normal.map((_, p) => -weighed.reduce((sum, { by, weight, size }) => sum + weight * size * by[p], 0));
    const more = normal.map((_, p) => normal.map((_, q) => weighed.reduce((sum, { by, weight, size, own }) =>
      sum + weight * (own + size * size) * by[p] * by[q], -shift[p] * shift[q])));
    return { shift, more };
  }

  function described(found) {
    const unit = found.normal.map((_, i) => found.normal.map((_, j) => i === j ? 1 : 0));
    const inverse = solved(found.normal, unit), widened = Math.max(found.misfit, 1);
    const { shift: off, more } = contact && found.noisy ? byContacts(found)
      : { shift: unit.map(() => 0), more: unit.map(row => row.map(() => 0)) };
    const u = toUnknown(found.state.map((v, i) => v + off[i])), [x, y, logD, g] = u;
    const c = (i, j) => (inverse[i][j] + more[i][j]) * given.sd[i] * given.sd[j] * widened;
    const shift = given.shift_mm ** 2 * widened, a = c(0, 0) + shift, b = c(0, 1), d = c(1, 1) + shift;
    const middle = (a + d) / 2, half = Math.hypot((a - d) / 2, b); // eigenvalues of the place's covariance
    const F = force(logD, g), by = 1 / Math.tanh(g);
    const sdF = F * Math.sqrt(4 * c(2, 2) + 4 * by * c(2, 3) + by * by * c(3, 3));
    const sds = [Math.sqrt(a), Math.sqrt(d), Math.exp(logD) * Math.sqrt(c(2, 2)), sdF];
    const here = at(u), near = sheet && rim && rim.step !== null && 1 - here.radius - here.half < rim.step;
    const factor = sds.map((sd, i) => given.interval[near ? 2 : sd > given.unsure_from[i] ? 1 : 0][i]);
    const named = ["x_mm", "y_mm", "d_mm", "F_N"], wide = given.ellipse * Math.max(factor[0], factor[1]) / given.normal;
    return {
      state: found.state, misfit: found.misfit, read: { x_mm: x, y_mm: y, d_mm: Math.exp(logD), F_N: F },
      half_width: Object.fromEntries(named.map((name, i) => [name, factor[i] * sds[i]])),
      ellipse: { long_mm: wide * Math.sqrt(middle + half), short_mm: wide * Math.sqrt(Math.max(middle - half, 0)),
                 angle_rad: Math.atan2(middle + half - a, b || 1e-30) },
      flag: found.misfit > given.misfit ? "unlike the trained touches" : "" };
  }

  const press = (x, y, d, F) => at([x, y, Math.log(d), Math.asinh(F / (d * d * given.p0))]).signal;
  return { press, read, readings };
}
