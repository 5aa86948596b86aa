// A page in a headless browser, with a record of what it logs and requests.
import { existsSync } from "node:fs";
import { pathToFileURL } from "node:url";
import puppeteer from "puppeteer-core";

const BROWSERS = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];

export async function browser(further = []) {
  const executablePath = process.env.CHROMIUM ?? BROWSERS.find(existsSync);
  if (!executablePath) throw new Error("found no Chromium: apt-get install chromium, or set CHROMIUM");
  return puppeteer.launch({
    executablePath,
    // Without a graphics card, WebGL is drawn by SwiftShader.
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars", ...further],
  });
}

/** Opens a file; returns the page, its console errors and its network requests. */
export async function opened(launched, file, { width = 1100, height = 800, scheme = "light" } = {}) {
  const page = await launched.newPage();
  const errors = [];
  const requests = [];
  page.on("console", (message) => {
    if (["error", "warn"].includes(message.type())) errors.push(message.text());
  });
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("request", (request) => {
    if (!/^(file|data|blob):/.test(request.url())) requests.push(request.url());
  });
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await page.setViewport({ width, height, deviceScaleFactor: 1 });
  await page.goto(pathToFileURL(file).href);
  await page.waitForSelector("body[data-ready]");
  return { page, errors, requests };
}
