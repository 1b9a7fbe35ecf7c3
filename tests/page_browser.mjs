// What the drivers of pages share: a server of this folder, and Chromium with a page of it open.
import { createServer } from 'http';
import { readFile } from 'fs/promises';
import puppeteer from 'puppeteer-core';

const TYPES = { html: 'text/html', js: 'text/javascript' };

export const folder = new URL('.', import.meta.url);

/** Calls use(page) with the page open, of a size in pixels, once window.still is there. */
export async function withPage(path, { width, height, chromium = '/usr/bin/chromium' }, use) {
  const server = createServer(async (request, response) => {
    try {
      const name = decodeURIComponent(request.url.split('?')[0]);
      const content = await readFile(new URL(`.${name}`, folder));
      response.setHeader('Content-Type', TYPES[name.split('.').pop()] ?? 'application/octet-stream');
      response.end(content);
    } catch {
      response.writeHead(404).end();
    }
  }).listen(0, '127.0.0.1');
  const browser = await puppeteer.launch({
    executablePath: chromium,
    args: ['--no-sandbox', '--enable-unsafe-swiftshader', '--use-angle=swiftshader'],
  });
  try {
    const page = await browser.newPage();
    page.on('pageerror', (error) => console.error(error.message));
    await page.setViewport({ width, height });
    await page.goto(`http://127.0.0.1:${server.address().port}/${path}`);
    await page.waitForFunction(() => window.still, { timeout: 120000 });
    await use(page);
  } finally {
    await browser.close();
    server.close();
  }
}
