// Bundles the page of a report into one HTML file without any reference to another.
//
// Usage: node build.mjs [OUT.html]; by default ../selfmodel/report/template.html.
import { readFile, rename, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const out = process.argv[2] ?? new URL("../selfmodel/report/template.html", import.meta.url).pathname;
const here = (name) => new URL(name, import.meta.url).pathname;

async function bundled(entry) {
  const result = await build({
    entryPoints: [here(entry)],
    bundle: true,
    minify: true,
    write: false,
    format: "iife",
    target: "es2022",
    legalComments: "inline",
    logLevel: "warning",
  });
  return result.outputFiles[0].text;
}

const script = (await bundled("src/main.js")).replaceAll("</script", "<\\/script");
const style = await bundled("src/style.css");
const page = (await readFile(here("src/page.html"), "utf8"))
  .replace("/*style*/", () => style)
  .replace("/*script*/", () => script);
await writeFile(`${out}.part`, page);
await rename(`${out}.part`, out);
