// Reads a report as a person does, and prints what the page shows as one JSON object.
//
// Usage: node read_report.mjs REPORT.html FRAME...
import { browser, opened } from "./page.mjs";

const [file, ...frames] = process.argv.slice(2);
const launched = await browser();
const { page, errors, requests } = await opened(launched, file);
const found = { errors, requests };
found.headline = await page.$eval("h1", (one) => one.textContent);
found.headings = await page.$$eval("h1, h2", (all) => all.map((one) => one.tagName));
found.unnamed = await page.$$eval("figure, svg[role=img], canvas, input, select, section, .scroll", (all) =>
  all
    .filter((one) => !one.getAttribute("aria-label") && !one.getAttribute("aria-labelledby") && !one.closest("label") && !one.querySelector("caption, figcaption, img[alt]") && !one.labels?.length)
    .map((one) => one.outerHTML.slice(0, 120)),
);

// Labels of bars that are on a bar or beyond the page, where they cannot be read.
found.illegible = await page.$$eval(".track .value", (all) =>
  all
    .filter((one) => {
      const bar = one.parentElement.querySelector(".fill").getBoundingClientRect();
      const label = one.getBoundingClientRect();
      return (label.left < bar.right - 2 && bar.left < label.right) || label.right > document.body.clientWidth;
    })
    .map((one) => one.textContent),
);

// Every table: those of sections, and those that are made as "Data as a table" is opened.
await page.$$eval("details.data", (all) => all.forEach((one) => (one.open = true)));
await page.waitForFunction(() => [...document.querySelectorAll("details.data")].every((one) => one.querySelector("table")));
await page.$$eval(".scroll > button:not([hidden])", (all) => all.forEach((one) => one.click()));
const tables = () =>
  page.$$eval("section:not(#motion) table", (all) =>
    all.map((one) => ({
      title: one.caption.textContent,
      rows: [...one.tBodies[0].rows].map((row) =>
        [...row.cells].map((cell) => (cell.dataset.value === undefined ? cell.textContent : Number(cell.dataset.value))),
      ),
    })),
  );
found.tables = await tables();

if (await page.$("#motion")) {
  found.canvas = await page.$eval(".stage", (one) => Boolean(one.querySelector("canvas")));
  found.trial = await page.$eval("#trial", (one) => one.value);
  const angles = () =>
    page.$$eval(".angles tbody tr", (rows) =>
      Object.fromEntries(rows.map((row) => [row.cells[0].textContent, [...row.cells].slice(1).map((cell) => [cell.dataset.value, cell.dataset.drawn].map(Number))])),
    );
  found.angles = {};
  for (const frame of frames) {
    await page.$eval("#time", (slider, value) => {
      slider.value = value;
      slider.dispatchEvent(new Event("input"));
    }, frame);
    found.angles[frame] = await angles();
  }
  // The keyboard alone: one step to the right of the beginning.
  await page.focus("#time");
  await page.keyboard.press("Home");
  await page.keyboard.press("ArrowRight");
  found.keyboard = await page.$eval("#time", (one) => [one.value, one.getAttribute("aria-valuetext")]);
}

// A heading sorts: down in the first column after two presses of Enter.
const button = await page.$("section:not(#motion) figure > .scroll th button");
if (button) {
  await button.focus();
  await page.keyboard.press("Enter");
  await page.keyboard.press("Enter");
  found.sorted = await button.evaluate((one) => [
    one.closest("th").getAttribute("aria-sort"),
    [...one.closest("table").tBodies[0].rows].map((row) => row.cells[0].textContent),
  ]);
}

await page.setViewport({ width: 390, height: 844 });
await page.waitForFunction(() => innerWidth === 390);
found.phone = await page.evaluate(() => document.documentElement.scrollWidth);

// A sheet of A4 within its margins: the rows of each table, and how much wider a table is.
await page.emulateMediaType("print");
await page.setViewport({ width: 688, height: 1000 });
await page.waitForFunction(() => innerWidth === 688);
found.print = await page.$$eval("section > figure.table table", (all) =>
  all.map((one) => ({
    rows: [...one.tBodies[0].rows].filter((row) => row.getClientRects().length).length,
    beyond: Math.max(0, Math.ceil(one.getBoundingClientRect().right) - innerWidth),
  })),
);
await launched.close();
process.stdout.write(`${JSON.stringify(found)}\n`);
