// Opens reports of which parts cannot be drawn, in a browser without WebGL, and prints what the
// reader sees instead as one JSON array.
//
// Usage: node read_failures.mjs REPORT.html...
import { browser, opened } from "./page.mjs";

const launched = await browser(["--disable-3d-apis"]);
const found = [];
for (const file of process.argv.slice(2)) {
  const { page, errors } = await opened(launched, file);
  const texts = (selector) => page.$$eval(selector, (all) => all.map((one) => one.textContent));
  const sections = await page.$$eval("section", (all) =>
    all.map((one) => ({
      key: one.id,
      heading: one.querySelector("h2").textContent,
      failures: [...one.querySelectorAll(".failure")].map((failure) => failure.textContent),
      figures: one.querySelectorAll("figure").length,
      rows: one.querySelectorAll("tbody tr").length,
      controls: one.querySelectorAll("input[type=range]").length,
    })),
  );
  found.push({ errors, headline: await texts("h1"), footer: await texts("footer"), failures: await texts("main > .failure"), sections });
}
await launched.close();
process.stdout.write(`${JSON.stringify(found)}\n`);
