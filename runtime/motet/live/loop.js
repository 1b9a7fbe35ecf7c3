// A figure that is steered: the loop of motet's matching.py and foot_lock.py on the numbers of a bundle, in plain
// JavaScript (and numbers.js), without anything of a browser. Metres, seconds and radians; y is up; an angle of 0 faces
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

// ---- the table --------------------------------------------------------------------------------------------------
// It comes gzipped: arrays one after the other, each column by column, of each column first all first bytes of its
// numbers, then all second ones and so on. N rows, K codes of a pose, F features.

const KINDS = { f2: Uint16Array, f4: Float32Array, i1: Int8Array, u1: Uint8Array, u2: Uint16Array };

async function gunzipped(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The arrays by name, row by row. */
function unpacked(bytes, arrays, rows) {
  const found = {};
  let at = 0;
  for (const { name, kind, width } of arrays) {
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

/** What a figure is steered with: the numbers as they come from Python (motet/live/page.py), the table unpacked, and
 *  for each gait the rows that can be jumped to. bytes: the gzipped table. */
async function netOf(given, bytes) {
  const net = { ...given, ...unpacked(await gunzipped(bytes), given.arrays, given.rows) };
  net.features = Float32Array.from(net.features, (step) => step / given.fine);
  net.half = new Float64Array(net.rows);
  for (let row = 0, at = 0; row < net.rows; row++) {
    for (let i = 0; i < net.mean.length; i++, at++) net.half[row] += net.features[at] ** 2 / 2;
  }
  net.places = new Float32Array(2 * net.rows);
  for (let row = 0; row < net.rows; row++) net.places.set(placeOf(net, rowOf(net, row)), 2 * row);
  net.shows = (row, gait) => (net.shown[row] >> gait) & 1;
  const all = Array.from({ length: net.rows }, (_, row) => row).filter((row) => net.left[row] >= Math.max(net.reserve, net.lasting));
  const fits = (row, gait) => net.shows(row, gait) && !flies(net, row);
  const goals = (gait) => all.filter((row) => fits(row, gait)).filter((_, i) => i % net.everyRow === 0);
  net.usable = net.gaits.map((_, gait) => Int32Array.from(goals(gait)));
  return net;
}

// ---- the search -------------------------------------------------------------------------------------------------

/** A figure that does what is stillest of its first gait; the n-th one searches in the n-th tick. */
function standing(net, [x, z, facing] = [0, 0, 0], n = 0) {
  const nothing = () => new Float64Array(net.codeSigns.length);
  return {
    row: net.still, side: 1, due: n % net.every, rate: 1, offset: nothing(), drift: nothing(),
    ground: [x, z, facing], going: [0, 0, 0, 0], looking: [facing, 0],
    control: { x: 0, z: 0, facing, gait: 0 }, shift: [[0, 0], [0, 0]], sliding: [[0, 0], [0, 0]], soles: null,
  };
}

/** Tell a figure its velocity over the ground, its facing, and which gait: what is new is searched for at once. */
function tell(net, figure, control) {
  const before = figure.control, now = { ...control, facing: wrapped(faced(net, control)) };
  const changed = ["x", "z", "facing"].some((name) => Math.abs(now[name] - before[name]) > 1e-4);
  if (changed || now.gait !== before.gait) figure.due = 0;
  figure.control = now;
}

/** A facing from which the gait can go where it is told: not all go sideways and backwards. */
function faced(net, { gait, x, z, facing }) {
  if (Math.hypot(x, z) < 1e-6) return facing;
  const way = Math.atan2(x, z), [, , , aside, back] = net.speeds[net.gaits[gait]];
  const farthest = Math.min(aside, back) > 0 ? Math.PI : net.forward;
  return way - clamp(wrapped(way - facing), -farthest, farthest);
}

function search(net, figure) {
  if (figure.due-- > 0) return;
  figure.due = net.every - 1;
  const { gait } = figure.control, row = toEven(figure.row), own = featuresAt(net, row, figure.side);
  const wanted = ways(net, figure).map((value, i) => (value - net.mean[i]) * net.scale[i]);
  const asked = own.map((value, i) => (i < wanted.length ? wanted[i] : value));
  const found = best(net, asked, gait);
  const ahead = found.row - row, near = ahead >= -net.behind && ahead <= net.before;
  const costHere = net.half[row] + lag(net, placeOf(net, own), placeOf(net, asked)) - dot(asked, own);
  const goesOn = net.shows(row, gait) && net.left[row] >= net.reserve;
  if (!goesOn || !(near || flies(net, row) || costHere <= found.cost)) jump(net, figure, found);
}

/** The nearest whole number, the even one where two are: as numpy has it. */
function toEven(x) {
  const low = Math.floor(x), part = x - low;
  return part === 0.5 ? low + (low % 2) : Math.round(x);
}

/** Whether neither foot stands: what flies goes on to do so. */
const flies = (net, row) => Math.max(net.moves[6 * row + 4], net.moves[6 * row + 5]) < net.stands;

const rowOf = (net, row) => net.features.subarray(row * net.mean.length, (row + 1) * net.mean.length);

function featuresAt(net, row, side) {
  const found = Array.from(rowOf(net, row));
  return side > 0 ? found : mirrored(net, found);
}

const mirrored = (net, features) => net.columns.map((column, i) => features[column] * net.signs[i]);

/** Where the springs lead after each of net.ahead, as features that are not yet scaled. */
function ways(net, { ground, going, looking, control }) {
  const [slow, calm] = [net.steering.velocity, net.steering.facing].map((half) => 2 * Math.LN2 / half);
  const cos = Math.cos(ground[2]), sin = Math.sin(ground[2]), wanted = [control.x, control.z];
  const off = plus(going.slice(0, 2), wanted, -1), rest = plus(going.slice(2), off, slow);
  const turned = wrapped(looking[0] - control.facing), rate = looking[1] + turned * calm;
  const places = [], facings = [];
  for (const time of net.ahead) {
    const left = Math.exp(-slow * time);
    const [x, z] = [0, 1].map((i) => (rest[i] / slow + off[i]) / slow
      - left * ((off[i] + rest[i] * time) / slow + rest[i] / slow ** 2) + wanted[i] * time);
    places.push(cos * x - sin * z, sin * x + cos * z);
    const angle = control.facing + Math.exp(-calm * time) * (turned + rate * time) - ground[2];
    facings.push(Math.sin(angle), Math.cos(angle));
  }
  const soon = Math.exp(-slow * net.ahead[1]);
  const speed = Math.hypot(...[0, 1].map((i) => wanted[i] + soon * (off[i] + rest[i] * net.ahead[1])));
  return [...places, ...facings, speed / (speed + net.haste)];
}

/** Where features lead after the last of net.ahead: left and forward. */
function placeOf(net, features) {
  const at = 2 * net.ahead.length - 2;
  return [at, at + 1].map((i) => features[i] / net.scale[i] + net.mean[i]);
}

/** What it costs that a place leads less than half as far on the way to another that is asked. */
function lag(net, [left, forward], [toLeft, toForward]) {
  const far = Math.hypot(toLeft, toForward);
  return net.lag * Math.max(far / 2 - (left * toLeft + forward * toForward) / Math.max(far, 1e-6), 0);
}

/** The row of a gait that is nearest to what is asked, as it is or mirrored. */
function best(net, asked, gait) {
  const count = asked.length, features = net.features, other = mirrored(net, asked);
  const to = placeOf(net, asked), toMirrored = placeOf(net, other);
  const found = { row: 0, side: 1, cost: Infinity }, image = { row: 0, side: -1, cost: Infinity };
  for (const row of net.usable[gait]) {
    const place = net.places.subarray(2 * row, 2 * row + 2);
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

/** Go on from another row; what the pose loses by it goes into the offset, and fades. */
function jump(net, figure, { row, side }) {
  const before = codesAt(net, figure.row, figure.side), after = codesAt(net, row, side);
  Object.assign(figure, { row, side });
  for (let k = 0; k < net.codeSigns.length; k++) {
    figure.offset[k] += before.codes[k] - after.codes[k];
    figure.drift[k] += before.speed[k] - after.speed[k];
  }
}

/** The codes of a pose at a place between two rows, and how fast they change. */
function codesAt(net, place, side) {
  const count = net.codeSigns.length, here = Math.floor(place), part = place - here;
  const codes = new Float64Array(count), speed = new Float64Array(count);
  for (let k = 0, at = here * count; k < count; k++, at++) {
    const sign = side > 0 ? 1 : net.codeSigns[k], change = net.codes[at + count] - net.codes[at];
    codes[k] = sign * (net.codes[at] + part * change);
    speed[k] = sign * change * net.fps;
  }
  return { codes, speed };
}

// ---- the step ---------------------------------------------------------------------------------------------------

/** The next pose, 1 / net.fps seconds later: ground (x, z, facing), rotations of the bones, height, contacts. */
function tick(net, figure) {
  search(net, figure);
  figure.row = Math.fround(figure.row + figure.rate);
  const pose = step(net, figure);
  return held(net, figure, pose);
}

function step(net, figure) {
  const how = net.steering, dt = how.dt, { codes } = codesAt(net, figure.row, figure.side);
  const [forward, left, turn, recorded, leftFoot, rightFoot] = movesAt(net, figure.row);
  spun(figure, how);
  const pace = Math.hypot(figure.going[0], figure.going[1]), rate = figure.rate;
  const moving = Math.min(recorded, pace) > how.idle, ratio = pace / Math.max(recorded, how.idle);
  const stride = rate * dt * (moving ? clamp(ratio / rate, ...how.strides) : 1);
  const turning = turn * rate * dt * figure.side;
  const [x, z, facing] = figure.ground, error = wrapped(figure.looking[0] - facing);
  const steps = inWorld(forward * stride, left * figure.side * stride, facing);
  const [stepX, stepZ] = moving ? veered(how, steps, figure.going) : steps;
  figure.ground = [x + stepX, z + stepZ, wrapped(facing + turning + bent(how, error, pace, turning))];
  figure.rate = Math.fround(moving ? clamp(ratio, ...how.rates) : 1);
  for (let k = 0; k < codes.length; k++) {
    [figure.offset[k], figure.drift[k]] = spring(figure.offset[k], figure.drift[k], how.blend, dt);
    codes[k] += figure.offset[k];
  }
  const contacts = figure.side > 0 ? [leftFoot, rightFoot] : [rightFoot, leftFoot];
  return { ground: figure.ground, ...poseOf(net, codes), contacts };
}

/** Velocity over the ground (forward, left, turn), speed, and how much each foot stands. */
function movesAt(net, place) {
  const here = Math.floor(place), part = place - here;
  return [0, 1, 2, 3, 4, 5].map((i) => {
    const first = net.moves[6 * here + i];
    return first + part * (net.moves[6 * here + 6 + i] - first);
  });
}

/** What is left after a tick of a distance and its speed, by a critically damped spring of a half-life. */
function spring(off, speed, half, dt) {
  const damping = 2 * Math.LN2 / half, rest = speed + off * damping, left = Math.exp(-damping * dt);
  return [left * (off + rest * dt), left * (speed - rest * damping * dt)];
}

/** The springs of velocity and facing, a tick later. */
function spun(figure, how) {
  const { x, z, facing } = figure.control, { going, looking } = figure;
  const [offX, speedX] = spring(going[0] - x, going[2], how.velocity, how.dt);
  const [offZ, speedZ] = spring(going[1] - z, going[3], how.velocity, how.dt);
  const [turned, rate] = spring(wrapped(looking[0] - facing), looking[1], how.facing, how.dt);
  figure.going = [x + offX, z + offZ, speedX, speedZ];
  figure.looking = [facing + turned, rate];
}

function inWorld(forward, left, facing) {
  const cos = Math.cos(facing), sin = Math.sin(facing);
  return [sin * forward + cos * left, cos * forward - sin * left];
}

/** By how much the facing is turned towards what is asked for, in one tick. */
function bent(how, error, pace, turning) {
  const [still, byPace, byTurn] = how.turning;
  const most = (still + byPace * Math.min(pace, 1.5)) * how.dt + byTurn * Math.abs(turning);
  return clamp(error * (1 - 0.5 ** (how.dt / how.turn)), -most, most);
}

/** A step turned towards a velocity by a small angle, where they do not go apart. */
function veered(how, [x, z], [toX, toZ]) {
  const along = x * toX + z * toZ, aside = z * toX - x * toZ;
  if (along <= 0.4 * Math.abs(aside)) return [x, z];
  const angle = clamp(Math.atan(aside / Math.max(along, 1e-6)), -how.veer, how.veer);
  return [x + angle * z, z - angle * x];
}

/** Codes to rotations and the hips' height: a linear map, then quaternions of unit length. */
function poseOf(net, codes) {
  const values = Float64Array.from(net.middle), count = values.length;
  codes.forEach((code, k) => { for (let i = 0; i < count; i++) values[i] += code * net.basis[k * count + i]; });
  const rotations = net.bones.map((_, bone) => unit(Array.from(values.subarray(4 * bone, 4 * bone + 4))));
  return { rotations, height: values[count - 1] };
}

/** Rotations and places of all joints in the world. */
function globalTransforms(net, pose) {
  const [x, z, facing] = pose.ground, turned = net.parents.map(() => [0, 0, 0, 1]), places = [];
  net.bones.forEach((joint, bone) => { turned[joint] = pose.rotations[bone]; });
  net.parents.forEach((parent, joint) => {
    const above = parent < 0 ? about([0, 1, 0], facing) : turned[parent];
    places[joint] = parent < 0 ? [x, pose.height, z] : plus(places[parent], rotated(above, net.offsets[joint]));
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
  const { turned, places } = globalTransforms(net, pose), { soles: points, legs } = net.lock;
  const soles = legs.map(({ joints }) => points.map(([part, point]) =>
    plus(places[joints[part]], rotated(turned[joints[part]], point))));
  const before = figure.soles ?? soles;
  figure.soles = soles;
  const rotations = [...pose.rotations];
  legs.forEach((leg, side) => {
    const shift = shifted(net, figure, side, before[side], pose.contacts[side] > 0.5);
    const lift = Math.max(0, ...soles[side].map((point) => -point[1]));
    if (shift[0] || shift[1] || lift) reach(net, leg, turned, places, [shift[0], lift, shift[1]], rotations);
  });
  return { ...pose, rotations };
}

/** By how much a foot is moved over the ground now. */
function shifted(net, figure, side, before, stands) {
  const { fade, farthest, swings } = net.lock, soles = figure.soles[side], heights = soles.map((point) => point[1]);
  const lowest = heights.indexOf(Math.min(...heights)), moved = plus(soles[lowest], before[lowest], -1);
  const [x, z] = figure.shift[side], stay = [x - moved[0], z - moved[2]];
  const calm = Math.hypot(moved[0], moved[2]) < swings / net.fps;
  if (stands && calm && norm(stay) < farthest) {
    figure.shift[side] = stay;
    figure.sliding[side] = [0, 0];
  } else {
    const faded = [0, 1].map((i) => spring(figure.shift[side][i], figure.sliding[side][i], fade, 1 / net.fps));
    figure.shift[side] = faded.map(([off]) => off);
    figure.sliding[side] = faded.map(([, speed]) => speed);
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
  rotations[bones[0]] = product(back(turned[net.parents[joints[0]]]), above);
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
function eased({ leg: { share, gives } }, { hip, ankle, longest }, target) {
  const away = plus(target, hip, -1), now = norm(plus(ankle, hip, -1)), wanted = norm(away);
  const left = Math.max(longest - now, 1e-9), less = Math.max(now - wanted, 0), [give, fade] = scaled(gives, longest);
  const longer = -share * left * Math.expm1(-Math.max(wanted - now, 0) / (share * left));
  const shorter = less ** 2 / Math.max(less + give * Math.exp(-left / fade), 1e-12);
  return plus(hip, away, (now + longer - shorter) / Math.max(wanted, 1e-12));
}

/** The turn of the whole leg, and before it that of the knee, which bring the ankle to a target. */
function turns({ leg: { shortest } }, leg, target) {
  const away = plus(target, leg.hip, -1), { upper, lower } = leg;
  const cosine = (dot(away, away) - upper ** 2 - lower ** 2) / (2 * upper * lower * leg.inPlane);
  const after = Math.acos(clamp(cosine, shortest, 1));
  const bend = about(leg.axis, after - leg.bend);
  return [shortestTurn(plus(leg.along, rotated(bend, leg.down)), away), bend];
}
