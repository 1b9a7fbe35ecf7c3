// A figure that is steered: the twin of motet's decode/steering.py, decode/matching.py and motion/feet/lock.py on the
// numbers of a bundle, in plain JavaScript (and numbers.js), without anything of a browser. Metres, seconds and radians; y is up; an angle of 0 faces
// z, positive ones are to the left, towards x. Quaternions are [x, y, z, w].

// ---- quaternions and vectors ------------------------------------------------------------------------------------

const wrapped = (angle) => angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
const plus = (a, b, times = 1) => a.map((x, i) => x + times * b[i]);
const scaled = (a, by) => a.map((x) => x * by);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const back = ([x, y, z, w]) => [-x, -y, -z, w];
const about = (axis, angle) => [...scaled(axis, Math.sin(angle / 2)), Math.cos(angle / 2)];

/** First the right turn, then the left. */
function product([ax, ay, az, aw], [bx, by, bz, bw]) {
  return [
    aw * bx + bw * ax + ay * bz - az * by, aw * by + bw * ay + az * bx - ax * bz,
    aw * bz + bw * az + ax * by - ay * bx, aw * bw - ax * bx - ay * by - az * bz,
  ];
}

function rotated(quat, vector) {
  const axis = quat.slice(0, 3), twice = scaled(cross(axis, vector), 2);
  return plus(plus(vector, twice, quat[3]), cross(axis, twice));
}

/** The shortest turn from the direction of one vector to that of another, which is not its opposite. */
function shortestTurn(start, end) {
  const axis = cross(unit(start), unit(end)), sine = norm(axis);
  return about(scaled(axis, 1 / Math.max(sine, 1e-12)), Math.atan2(sine, dot(unit(start), unit(end))));
}

// ---- springs ----------------------------------------------------------------------------------------------------
// Critically damped: a distance from rest and its rate, of a half-life, some seconds later.

const dampingOf = (halfLife) => 2 * Math.LN2 / halfLife;

function damped(off, rate, halfLife, seconds) {
  const damping = dampingOf(halfLife), rise = (rate + damping * off) * seconds, left = Math.exp(-damping * seconds);
  return [(off + rise) * left, (rate - damping * rise) * left];
}

/** The integral of the distance over those seconds. */
function dampedPath(off, rate, halfLife, seconds) {
  const damping = dampingOf(halfLife), rise = rate / damping + off, left = Math.exp(-damping * seconds);
  return (rise + off - left * (rise + off + rise * damping * seconds)) / damping;
}

// ---- the tables -------------------------------------------------------------------------------------------------
// They come gzipped: one after the other, each column by column, of each column first all first bytes of its numbers,
// then all second ones and so on. N rows, K codes of a pose, F features.

const KINDS = { f2: Uint16Array, f4: Float32Array, i1: Int8Array, u1: Uint8Array, i4: Int32Array };

async function gunzipped(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The tables by name, row by row. */
function unpacked(bytes, tables) {
  const found = {};
  let at = 0;
  for (const [name, { kind, shape: [rows, width] }] of Object.entries(tables)) {
    const size = KINDS[kind].BYTES_PER_ELEMENT, target = new Uint8Array(rows * width * size);
    for (let column = 0; column < width; column++) {
      for (let byte = 0; byte < size; byte++) {
        for (let row = 0; row < rows; row++) target[(row * width + column) * size + byte] = bytes[at++];
      }
    }
    found[name] = kind === "f2" ? fromHalves(new Uint16Array(target.buffer)) : new KINDS[kind](target.buffer);
  }
  return found;
}

function fromHalves(halves) {
  const values = Float32Array.from({ length: 1 << 16 }, (_, bits) => {
    const exponent = (bits >> 10) & 31, rest = bits & 1023;
    const size = exponent ? (1 + rest / 1024) * 2 ** (exponent - 15) : rest * 2 ** -24;
    return bits >> 15 ? -size : size;
  });
  return Float32Array.from(halves, (bits) => values[bits]);
}

/** What a figure is steered with: the numbers as they come from Python (motet/live/page.py), the tables unpacked, and
 *  for each gait the rows that can be jumped to. */
async function netOf(given) {
  const tables = unpacked(await gunzipped(new Uint8Array(bytesOf(given.bytes))), given.tables);
  const net = { ...given, ...tables, rows: tables.left.length, count: tables.feature_mean.length };
  const how = net.steering, codes = tables.codes.length / net.rows;
  net.codeSigns = Array.from({ length: codes }, (_, k) => (k < codes - net.odd ? 1 : -1));
  net.horizons = [1, 2, 3].map((n) => how.horizon * n / 3);
  net.reserve = Math.ceil((how.search_every + 1) * how.fastest) + 2;
  net.features = Float32Array.from(net.features, (step) => step / net.featureSteps);
  net.half = Float64Array.from({ length: net.rows }, (_, row) => dot(rowOf(net, row), rowOf(net, row)) / 2);
  net.places = Array.from({ length: net.rows }, (_, row) => placeOf(net, rowOf(net, row)));
  const lasts = (row) => net.left[row] >= Math.max(net.reserve, how.lasting) && !flies(net, row);
  const all = Array.from({ length: net.rows }, (_, row) => row).filter(lasts);
  const goals = (gait) => all.filter((row) => shows(net, row, gait)).filter((_, i) => i % how.row_step === 0);
  net.goals = net.gaits.map((_, gait) => Int32Array.from(goals(gait)));
  return net;
}

// ---- the search -------------------------------------------------------------------------------------------------

/** A figure that does what is stillest of its first gait; the n-th one searches in the n-th tick. */
function standing(net, [x, z, facing] = [0, 0, 0], n = 0) {
  const nothing = () => new Float64Array(net.codeSigns.length);
  return {
    row: net.still, part: 0, mirror: 0, rate: 1, ticksToSearch: n % net.steering.search_every,
    root: [x, z, facing], spring: [0, 0, facing], springRate: [0, 0, 0], offset: nothing(), offsetRate: nothing(),
    target: { x: 0, z: 0, facing, gait: 0 }, shift: [[0, 0], [0, 0]], drift: [[0, 0], [0, 0]], soles: null,
  };
}

/** Tell a figure its velocity over the ground, its facing, and which gait: what is new is searched for at once. */
function tell(net, figure, target) {
  const before = figure.target, now = { ...target, facing: wrapped(facingFor(net, target)) };
  const changed = ["x", "z", "facing"].some((name) => Math.abs(now[name] - before[name]) > 1e-4);
  if (changed || now.gait !== before.gait) figure.ticksToSearch = 0;
  figure.target = now;
}

/** A facing from which the gait can go where it is told: not all go sideways and backwards. */
function facingFor(net, { gait, x, z, facing }) {
  if (Math.hypot(x, z) < 1e-6) return facing;
  const direction = Math.atan2(x, z), [, , , aside, back] = net.speeds[net.gaits[gait]];
  const farthest = Math.min(aside, back) > 0 ? Math.PI : net.steering.ahead;
  return direction - clamp(wrapped(direction - facing), -farthest, farthest);
}

function search(net, figure) {
  if (figure.ticksToSearch-- > 0) return;
  const how = net.steering, { gait } = figure.target, row = figure.row + (figure.part > 0.5 ? 1 : 0);
  figure.ticksToSearch = how.search_every - 1;
  const own = Array.from(rowOf(net, row)), asked = figure.mirror ? mirrored(net, own) : own, here = [...asked];
  desiredTrajectory(net, figure).forEach((value, i) => {
    asked[i] = (value - net.feature_mean[i]) * net.feature_scale[i];
  });
  const found = best(net, asked, gait), ahead = found.row - row;
  const near = ahead >= -how.jump_back && ahead <= how.jump_ahead;
  const cost = net.half[row] + lag(net, placeOf(net, here), placeOf(net, asked)) - dot(asked, here);
  const stays = shows(net, row, gait) && net.left[row] >= net.reserve;
  if (!stays || !(near || flies(net, row) || cost <= found.cost)) jump(net, figure, found);
}

const shows = (net, row, gait) => net.shows[row * net.gaits.length + gait] > 0;

/** Whether neither foot stands: a flight is played to its end. */
const flies = (net, row) => Math.max(net.moves[6 * row + 4], net.moves[6 * row + 5]) < net.steering.stands;

const rowOf = (net, row) => net.features.subarray(row * net.count, (row + 1) * net.count);
const mirrored = (net, features) => net.columns.map((column, i) => features[column] * net.signs[i]);

/** Where the springs lead at each of the horizons, as features that are not yet scaled. */
function desiredTrajectory(net, { root, spring, springRate, target }) {
  const { velocity, facing: halfLife, half_speed } = net.steering, facing = root[2];
  const cos = Math.cos(facing), sin = Math.sin(facing), wanted = [target.x, target.z];
  const turned = wrapped(spring[2] - target.facing), places = [], facings = [];
  for (const time of net.horizons) {
    const [x, z] = wanted.map((v, i) => v * time + dampedPath(spring[i] - v, springRate[i], velocity, time));
    places.push(cos * x - sin * z, sin * x + cos * z);
    const angle = target.facing + damped(turned, springRate[2], halfLife, time)[0] - facing;
    facings.push(Math.sin(angle), Math.cos(angle));
  }
  const soon = wanted.map((v, i) => v + damped(spring[i] - v, springRate[i], velocity, net.horizons[1])[0]);
  const speed = Math.hypot(...soon);
  return [...places, ...facings, speed / (speed + half_speed)];
}

/** Where features lead at the last of the horizons: left and forward. */
function placeOf(net, features) {
  const at = 2 * net.horizons.length - 2;
  return [at, at + 1].map((i) => features[i] / net.feature_scale[i] + net.feature_mean[i]);
}

/** What it costs that a place leads less than half as far on the way to another that is asked. */
function lag(net, [left, forward], [toLeft, toForward]) {
  const far = Math.hypot(toLeft, toForward);
  return net.steering.lag * Math.max(far / 2 - (left * toLeft + forward * toForward) / Math.max(far, 1e-6), 0);
}

/** The row of a gait that is nearest to what is asked, as it is or mirrored. */
function best(net, asked, gait) {
  const count = net.count, features = net.features, other = mirrored(net, asked);
  const to = placeOf(net, asked), toMirrored = placeOf(net, other);
  const found = { row: 0, mirror: 0, cost: Infinity }, image = { row: 0, mirror: 1, cost: Infinity };
  for (const row of net.goals[gait]) {
    const place = net.places[row];
    let cost = net.half[row] + lag(net, place, to), mirroredCost = net.half[row] + lag(net, place, toMirrored);
    for (let i = 0, at = row * count; i < count; i++, at++) {
      cost -= asked[i] * features[at];
      mirroredCost -= other[i] * features[at];
    }
    if (cost < found.cost) Object.assign(found, { row, cost });
    if (mirroredCost < image.cost) Object.assign(image, { row, cost: mirroredCost });
  }
  return image.cost < found.cost ? image : found;
}

/** Go on from another row; what the pose loses by it goes into the inertialization offset. */
function jump(net, figure, { row, mirror }) {
  const before = codesAt(net, figure);
  Object.assign(figure, { row, mirror, part: 0 });
  const after = codesAt(net, figure);
  for (let k = 0; k < net.codeSigns.length; k++) {
    figure.offset[k] += before.codes[k] - after.codes[k];
    figure.offsetRate[k] += before.rate[k] - after.rate[k];
  }
}

/** The codes that are played, and how fast they change. */
function codesAt(net, { row, part, mirror }) {
  const count = net.codeSigns.length, codes = new Float64Array(count), rate = new Float64Array(count);
  for (let k = 0, at = row * count; k < count; k++, at++) {
    const sign = mirror ? net.codeSigns[k] : 1, change = net.codes[at + count] - net.codes[at];
    codes[k] = sign * (net.codes[at] + part * change);
    rate[k] = sign * change * net.fps;
  }
  return { codes, rate };
}

// ---- the step ---------------------------------------------------------------------------------------------------

/** The next pose, 1 / net.fps seconds later: ground (x, z, facing), rotations of the bones, height, contacts. */
function tick(net, figure) {
  search(net, figure);
  const at = figure.part + figure.rate, whole = Math.floor(at);
  Object.assign(figure, { row: figure.row + whole, part: at - whole });
  return held(net, figure, step(net, figure));
}

function step(net, figure) {
  const how = net.steering, dt = 1 / net.fps, { codes } = codesAt(net, figure), side = figure.mirror ? -1 : 1;
  const [forward, left, turn, recorded, leftFoot, rightFoot] = movesAt(net, figure);
  approach(figure, how, dt);
  const pace = Math.hypot(figure.spring[0], figure.spring[1]), { rate, root: [x, z, facing] } = figure;
  const moving = Math.min(recorded, pace) > how.idle, ratio = pace / Math.max(recorded, how.idle);
  const stride = rate * dt * (moving ? clamp(ratio / rate, how.shortest, how.longest) : 1);
  const turning = turn * rate * dt * side, error = wrapped(figure.spring[2] - facing);
  const steps = inWorld(forward * stride, left * side * stride, facing);
  const [stepX, stepZ] = moving ? veered(how, steps, figure.spring) : steps;
  figure.root = [x + stepX, z + stepZ, wrapped(facing + turning + corrected(how, dt, error, pace, turning))];
  figure.rate = moving ? clamp(ratio, how.slowest, how.fastest) : 1;
  for (let k = 0; k < codes.length; k++) {
    [figure.offset[k], figure.offsetRate[k]] = damped(figure.offset[k], figure.offsetRate[k], how.blend, dt);
    codes[k] += figure.offset[k];
  }
  const contacts = figure.mirror ? [rightFoot, leftFoot] : [leftFoot, rightFoot];
  return { ground: figure.root, ...poseOf(net, codes), contacts };
}

/** Velocity over the ground (forward, left, turn), speed, and how much each foot stands. */
function movesAt(net, { row, part }) {
  return [0, 1, 2, 3, 4, 5].map((i) => mix(net.moves[6 * row + i], net.moves[6 * row + 6 + i], part));
}

/** The springs of velocity and facing, a tick later. */
function approach(figure, how, dt) {
  const { target: { x, z, facing }, spring, springRate } = figure;
  const next = [x, z, facing].map((wanted, i) => {
    const off = spring[i] - wanted, halfLife = i < 2 ? how.velocity : how.facing;
    return damped(i < 2 ? off : wrapped(off), springRate[i], halfLife, dt);
  });
  figure.spring = [x + next[0][0], z + next[1][0], facing + next[2][0]];
  figure.springRate = next.map(([, rate]) => rate);
}

function inWorld(forward, left, facing) {
  const cos = Math.cos(facing), sin = Math.sin(facing);
  return [sin * forward + cos * left, cos * forward - sin * left];
}

/** By how much the facing is turned towards what is asked for, in one tick. */
function corrected(how, dt, error, pace, turning) {
  const most = (how.turn_still + how.turn_moving * Math.min(pace, how.turn_speed)) * dt
    + how.turn_turning * Math.abs(turning);
  return clamp(error * (1 - 0.5 ** (dt / how.turn)), -most, most);
}

/** A step turned towards a velocity by a small angle, where they do not go apart. */
function veered(how, [x, z], [toX, toZ]) {
  const along = x * toX + z * toZ, aside = z * toX - x * toZ;
  if (along <= how.veer_within * Math.abs(aside)) return [x, z];
  const angle = clamp(Math.atan(aside / Math.max(along, 1e-6)), -how.veer, how.veer);
  return [x + angle * z, z - angle * x];
}

/** Codes to rotations and the hips' height: a linear map, then quaternions of unit length. */
function poseOf(net, codes) {
  const values = Float64Array.from(net.pose_mean), count = values.length;
  codes.forEach((code, k) => { for (let i = 0; i < count; i++) values[i] += code * net.pose_basis[k * count + i]; });
  const rotations = net.figure.bones.map((_, bone) => unit(Array.from(values.subarray(4 * bone, 4 * bone + 4))));
  return { rotations, height: values[count - 1] };
}

/** Rotations and places of all joints in the world. */
function globalTransforms(net, pose) {
  const { parents, bones, offsets } = net.figure;
  const [x, z, facing] = pose.ground, turned = parents.map(() => [0, 0, 0, 1]), places = [];
  bones.forEach((joint, bone) => { turned[joint] = pose.rotations[bone]; });
  parents.forEach((parent, joint) => {
    const above = parent < 0 ? about([0, 1, 0], facing) : turned[parent];
    places[joint] = parent < 0 ? [x, pose.height, z] : plus(places[parent], rotated(above, offsets[joint]));
    turned[joint] = product(above, turned[joint]);
  });
  return { turned, places };
}

/** The pose part of the way to another, which is near. */
function towards(pose, other, part) {
  const mixed = (a, b) => a.map((x, i) => x + part * (b[i] - x));
  const [x, z, facing] = other.ground, near = pose.ground[2] + wrapped(facing - pose.ground[2]);
  return {
    ground: mixed(pose.ground, [x, z, near]), height: mixed([pose.height], [other.height])[0],
    contacts: mixed(pose.contacts, other.contacts),
    rotations: pose.rotations.map((quat, i) => {
      const next = other.rotations[i];
      return unit(mixed(quat, dot(quat, next) < 0 ? scaled(next, -1) : next));
    }),
  };
}

// ---- the feet ---------------------------------------------------------------------------------------------------

/** The pose with feet that stay where they stand, and not under the ground. */
function held(net, figure, pose) {
  const { turned, places } = globalTransforms(net, pose), { soles: points, legs, lock } = net.figure;
  const soles = legs.map(({ joints }) => points.map(([part, point]) =>
    plus(places[joints[part]], rotated(turned[joints[part]], point))));
  const before = figure.soles ?? soles;
  figure.soles = soles;
  const rotations = [...pose.rotations];
  legs.forEach((leg, side) => {
    const shift = shifted(net, figure, side, before[side], pose.contacts[side] > lock.stands);
    const lift = Math.max(0, ...soles[side].map((point) => -point[1]));
    if (shift[0] || shift[1] || lift) reach(net, leg, turned, places, [shift[0], lift, shift[1]], rotations);
  });
  return { ...pose, rotations };
}

/** By how much a foot is moved over the ground now. */
function shifted(net, figure, side, before, stands) {
  const { fade, farthest, swings } = net.figure.lock, soles = figure.soles[side], heights = soles.map((point) => point[1]);
  const lowest = heights.indexOf(Math.min(...heights)), moved = plus(soles[lowest], before[lowest], -1);
  const [x, z] = figure.shift[side], stay = [x - moved[0], z - moved[2]];
  const calm = Math.hypot(moved[0], moved[2]) < swings / net.fps;
  if (stands && calm && norm(stay) < farthest) {
    figure.shift[side] = stay;
    figure.drift[side] = [0, 0];
  } else {
    const faded = [0, 1].map((i) => damped(figure.shift[side][i], figure.drift[side][i], fade, 1 / net.fps));
    figure.shift[side] = faded.map(([off]) => off);
    figure.drift[side] = faded.map(([, speed]) => speed);
  }
  return figure.shift[side];
}

/** Turn thigh, shin and foot of a leg so that the ankle is moved; the foot stays as it is in the world. */
function reach(net, { joints, bones }, turned, places, move, rotations) {
  const [hip, knee, ankle] = joints.map((joint) => places[joint]);
  const [thigh, shin, foot] = joints.map((joint) => turned[joint]);
  const leg = legOf(hip, knee, ankle, rotated(shin, [1, 0, 0]));
  const [swing, bend] = turns(net, leg, eased(net, leg, plus(ankle, move)));
  const above = product(swing, thigh), below = product(swing, product(bend, shin));
  rotations[bones[0]] = product(back(turned[net.figure.parents[joints[0]]]), above);
  rotations[bones[1]] = product(back(above), below);
  rotations[bones[2]] = product(back(below), foot);
}

function legOf(hip, knee, ankle, hinge) {
  const along = plus(knee, hip, -1), down = plus(ankle, knee, -1);
  const axis = unit(plus(hinge, along, -dot(hinge, along) / dot(along, along)));
  const upper = norm(along), lower = norm(down), out = dot(unit(down), axis);
  const inPlane = Math.sqrt(Math.max(1 - out * out, 1e-12));
  const longest = Math.sqrt(upper ** 2 + lower ** 2 + 2 * upper * lower * inPlane);
  const bend = Math.atan2(dot(cross(along, down), axis), dot(along, down));
  return { hip, ankle, along, down, axis, upper, lower, inPlane, longest, bend };
}

/** The place near a target, on the line to the hip, that the ankle comes to without a snap of the knee. */
function eased({ figure: { knee: { share, gives } } }, { hip, ankle, longest }, target) {
  const away = plus(target, hip, -1), now = norm(plus(ankle, hip, -1)), wanted = norm(away);
  const left = Math.max(longest - now, 1e-9), less = Math.max(now - wanted, 0), [give, fade] = scaled(gives, longest);
  const longer = -share * left * Math.expm1(-Math.max(wanted - now, 0) / (share * left));
  const shorter = less ** 2 / Math.max(less + give * Math.exp(-left / fade), 1e-12);
  return plus(hip, away, (now + longer - shorter) / Math.max(wanted, 1e-12));
}

/** The turn of the whole leg, and before it that of the knee, which bring the ankle to a target. */
function turns({ figure: { knee: { shortest } } }, leg, target) {
  const away = plus(target, leg.hip, -1), { upper, lower } = leg;
  const cosine = (dot(away, away) - upper ** 2 - lower ** 2) / (2 * upper * lower * leg.inPlane);
  const after = Math.acos(clamp(cosine, shortest, 1));
  const bend = about(leg.axis, after - leg.bend);
  return [shortestTurn(plus(leg.along, rotated(bend, leg.down)), away), bend];
}
