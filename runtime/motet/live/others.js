// The figures that are not steered by hand: they follow the first one, or wander about. Metres, seconds, radians.

const ROOM = 0.8, FAR = 9;

/** Numbers between 0 and 1 that look random, the same ones every time: the Lehmer generator. */
function randomFrom(seed) {
  let state = (seed * 7919 + 17) % 2147483647;
  return () => (state = (state * 48271) % 2147483647) / 2147483647;
}

/** What another figure does next: it goes after the first figure, or where its mood leads it. n: from 1. */
function ownControl(net, figures, n, follows) {
  const figure = figures[n], leader = figures[0], [x, z] = figure.root;
  const away = Math.hypot(leader.root[0] - x, leader.root[1] - z);
  if (follows || away > FAR) return followed(net, figures, n);
  const mood = (figure.mood ??= { left: 0, random: randomFrom(n) });
  if (--mood.left <= 0) Object.assign(mood, newMood(net, figure, mood.random));
  return towardsPoint(net, figures, n, [x + 3 * Math.sin(mood.way), z + 3 * Math.cos(mood.way)], mood.pace);
}

/** A way to go for a while, sometimes none. */
function newMood(net, figure, random) {
  const rests = random() < 0.25, [, usual] = net.speeds[net.gaits[0]];
  const way = figure.root[2] + (random() - 0.5) * 4;
  return { left: net.fps * (2 + 4 * random()), way, pace: rests ? 0 : usual * (0.6 + 0.4 * random()) };
}

/** Behind the first figure, left and right in turns, and ever farther behind. */
function followed(net, figures, n) {
  const [x, z, facing] = figures[0].root, angle = facing + Math.PI + (n % 2 ? 0.6 : -0.6);
  const behind = 0.7 + 0.5 * n, point = [x + behind * Math.sin(angle), z + behind * Math.cos(angle)];
  const [dx, dz] = [point[0] - figures[n].root[0], point[1] - figures[n].root[1]], away = Math.hypot(dx, dz);
  const stays = away < (Math.hypot(...figures[n].velocity) < 0.1 ? 0.8 : 0.3);
  return towardsPoint(net, figures, n, point, stays ? 0 : Math.max(0.7, 1.3 * away));
}

/** The control that leads to a point at a pace, around others; faster than the first gait has, it runs. */
function towardsPoint(net, figures, n, [toX, toZ], pace) {
  const figure = figures[n], [x, z] = figure.root;
  let [vx, vz] = unit([toX - x, toZ - z]).map((part) => part * pace);
  figures.forEach((other, i) => {
    const dx = x - other.root[0], dz = z - other.root[1], gap = Math.hypot(dx, dz);
    if (i === n || gap > ROOM || gap < 1e-6) return;
    vx += dx / gap * (ROOM - gap) * 2;
    vz += dz / gap * (ROOM - gap) * 2;
  });
  const wanted = Math.hypot(vx, vz), fast = fastest(net), top = net.speeds[net.gaits[0]][2];
  const gait = wanted > (figure.asked.gait === fast ? 0.8 : 1) * top ? fast : 0;
  const speed = wanted < 0.25 ? 0 : inRange(net.model, gait, wanted), ratio = wanted ? speed / wanted : 0;
  const facing = speed ? Math.atan2(vx, vz) : figure.asked.facing;
  return { gait, x: vx * ratio, z: vz * ratio, facing };
}

/** The gait that is the fastest mostly. */
function fastest(net) {
  const usual = net.gaits.map((gait) => net.speeds[gait][1]);
  return usual.indexOf(Math.max(...usual));
}
