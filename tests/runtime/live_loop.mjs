// Runs the loop of a live page without a browser: JSON {scripts, net, controls} on stdin; poses, and each tick's milliseconds.
import { readFileSync } from 'fs';

const { scripts, net: given, controls } = JSON.parse(readFileSync(0));
const names = '{ netOf, standing, tell, tick, globalTransforms }';
const loop = new Function(`${scripts.join('\n')}\nreturn ${names};`)();
const net = await loop.netOf(given);
const figure = loop.standing(net);
const milliseconds = [];
const poses = controls.map((control) => {
  const start = performance.now();
  loop.tell(net, figure, control);
  const pose = loop.tick(net, figure);
  milliseconds.push(performance.now() - start);
  return pose;
});
const positions = poses.map((pose) => loop.globalTransforms(net, pose).places);
console.log(JSON.stringify({ poses, positions, milliseconds }));
