// Pictures of a report: light, dark, as on a phone, and printed.
//
// Usage: node screenshots.mjs REPORT.html FOLDER [TRIAL [SHARE]]; TRIAL is its number, SHARE of its
// time is shown.
import { join } from "node:path";
import { browser, opened } from "./page.mjs";

const [file, folder, trial = 1, share = 0.6] = process.argv.slice(2);
const LOOKS = {
  light: {},
  dark: { scheme: "dark" },
  phone: { width: 390, height: 844 },
};

const launched = await browser();
for (const [name, look] of Object.entries(LOOKS)) {
  const { page, errors } = await opened(launched, file, look);
  if (await page.$("#time")) await show(page);
  await page.screenshot({ path: join(folder, `${name}.png`), fullPage: true });
  if (name === "light") await page.pdf({ path: join(folder, "print.pdf"), format: "A4" });
  console.log(name, errors);
}
await launched.close();

async function show(page) {
  await page.$eval("#trial", (choice, number) => {
    choice.selectedIndex = Math.min(number, choice.length - 1);
    choice.dispatchEvent(new Event("change"));
  }, Number(trial));
  await page.$eval("#time", (slider, part) => {
    slider.value = slider.max * part;
    slider.dispatchEvent(new Event("input"));
  }, Number(share));
}
