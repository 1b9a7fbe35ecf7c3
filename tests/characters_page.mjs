// Takes a picture of characters side by side, each in the first of its clips at the given times, one row for each, and
// prints how high over the floor their meshes begin and end: FOLDER/characters.png.
//   motet generate "a person kicks" --onto A.glb -o FOLDER/a.glb      (as often as there are characters)
//   npm install --prefix FOLDER three puppeteer-core
//   cp tests/*page* FOLDER && node FOLDER/characters_page.mjs SECONDS[,SECONDS...] a.glb b.glb ...
// A.glb+CLIP.glb plays a clip of another file on the nodes of A.glb by their names, as --like writes them.
import { folder, withPage } from './page_browser.mjs';

const [times, ...files] = process.argv.slice(2);
const size = { width: 240 * files.length, height: 300 };
const query = new URLSearchParams({ files: files.join(',') });

await withPage(`characters_page.html?${query}`, { ...size, height: size.height * times.split(',').length }, async (page) => {
  const found = await page.evaluate((given) => window.still(given), times.split(',').map(Number));
  await page.screenshot({ path: new URL('characters.png', folder).pathname });
  for (const { file, seconds, lowest, top } of found) {
    console.log(`${file} at ${seconds} s: from ${(100 * lowest).toFixed(1)} to ${(100 * top).toFixed(1)} cm`);
  }
});
