// Plays a VRM animation on a VRM avatar in a page and takes pictures of it: still-N.png, with what was measured.
//   motet generate "a person walks" -o FOLDER/motion.vrma && python tests/vrm_avatar.py FOLDER/avatar.vrm
//   npm install --prefix FOLDER three @pixiv/three-vrm @pixiv/three-vrm-animation puppeteer-core
//   cp tests/*page* FOLDER && node FOLDER/vrma_page.mjs [CHROMIUM]
// Another avatar.vrm can take the place of ours. `python -m http.server -d FOLDER` shows the page to people.
import { folder, withPage } from './page_browser.mjs';

const STILLS = 8;

await withPage('vrma_page.html', { width: 1000, height: 600, chromium: process.argv[2] }, async (page) => {
  const duration = await page.evaluate(() => window.duration);
  for (let n = 0; n < STILLS; n++) {
    const seconds = (duration * n) / (STILLS - 1);
    const { hips, head, leftFoot, rightFoot, lowest, top, facing } = await page.evaluate((t) => window.still(t), seconds);
    await page.screenshot({ path: new URL(`still-${n}.png`, folder).pathname });
    const cm = (number) => (100 * number).toFixed(1).padStart(6);
    console.log(`${seconds.toFixed(2)} s  hips at z ${cm(hips[2])} cm  head over hips ${cm(head[1] - hips[1])}  top ${cm(top)}`
      + `  lowest ${cm(lowest)}  left foot ahead of the right ${cm(leftFoot[2] - rightFoot[2])}  facing ${facing.map((x) => x.toFixed(2))}`);
  }
});
