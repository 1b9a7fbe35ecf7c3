// Plays a VRM animation on a VRM avatar in a page and takes pictures of it: still-N.png, with what was measured.
//   motet generate "a person walks" -o FOLDER/motion.vrma && python tests/vrm_avatar.py FOLDER/avatar.vrm
//   npm install --prefix FOLDER three @pixiv/three-vrm @pixiv/three-vrm-animation puppeteer-core
//   cp tests/vrma_page.* FOLDER && node FOLDER/vrma_page.mjs [CHROMIUM]
// Another avatar.vrm can take the place of ours. `python -m http.server -d FOLDER` shows the page to people.
import { createServer } from 'http';
import { readFile } from 'fs/promises';
import puppeteer from 'puppeteer-core';

const folder = new URL('.', import.meta.url);
const TYPES = { html: 'text/html', js: 'text/javascript' };
const STILLS = 8;

const server = createServer(async (request, response) => {
  try {
    const content = await readFile(new URL(`.${request.url}`, folder));
    response.setHeader('Content-Type', TYPES[request.url.split('.').pop()] ?? 'application/octet-stream');
    response.end(content);
  } catch {
    response.writeHead(404).end();
  }
}).listen(0, '127.0.0.1');

const browser = await puppeteer.launch({
  executablePath: process.argv[2] ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--enable-unsafe-swiftshader', '--use-angle=swiftshader'],
});
try {
  const page = await browser.newPage();
  page.on('pageerror', (error) => console.error(error.message));
  await page.setViewport({ width: 1000, height: 600 });
  await page.goto(`http://127.0.0.1:${server.address().port}/vrma_page.html`);
  await page.waitForFunction(() => window.still, { timeout: 60000 });
  const duration = await page.evaluate(() => window.duration);
  for (let n = 0; n < STILLS; n++) {
    const seconds = (duration * n) / (STILLS - 1);
    const { hips, head, leftFoot, rightFoot, lowest, top, facing } = await page.evaluate((t) => window.still(t), seconds);
    await page.screenshot({ path: new URL(`still-${n}.png`, folder).pathname });
    const cm = (number) => (100 * number).toFixed(1).padStart(6);
    console.log(`${seconds.toFixed(2)} s  hips at z ${cm(hips[2])} cm  head over hips ${cm(head[1] - hips[1])}  top ${cm(top)}`
      + `  lowest ${cm(lowest)}  left foot ahead of the right ${cm(leftFoot[2] - rightFoot[2])}  facing ${facing.map((x) => x.toFixed(2))}`);
  }
} finally {
  await browser.close();
  server.close();
}
