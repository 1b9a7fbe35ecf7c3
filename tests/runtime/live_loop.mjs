// Runs the script of a live page without a browser: JSON {script, net, controls} on stdin; the poses of its figure.
import { readFileSync } from 'fs';

const { script, net, controls } = JSON.parse(readFileSync(0));
const { Figure, modelOf } = new Function(`${script}\nreturn motetControl;`)();
const figure = new Figure(await modelOf(net), [0, 0, 0]);
const milliseconds = [];
const poses = controls.map((control) => {
  const start = performance.now();
  figure.tick(control);
  milliseconds.push(performance.now() - start);
  const shown = figure.shown(1);
  return { ...shown, rotations: [...shown.rotations] };
});
console.log(JSON.stringify({ poses, milliseconds }));
