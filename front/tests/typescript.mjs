// Lets node's own test runner read the sources: `node --import ./tests/typescript.mjs --test tests/`.
import { existsSync, readFileSync } from "node:fs";
import { register } from "node:module";
import { fileURLToPath } from "node:url";
import { isMainThread } from "node:worker_threads";
import ts from "typescript";

if (isMainThread) register(import.meta.url);

export async function resolve(name, context, next) {
  if (/^\.\.?\//.test(name) && !/\.[cm]?[jt]s$|\.css$/.test(name)) {
    const url = new URL(`${name}.ts`, context.parentURL);
    if (existsSync(fileURLToPath(url))) return { url: url.href, shortCircuit: true };
  }
  return next(name, context);
}

export async function load(url, context, next) {
  if (url.endsWith(".css")) return { format: "module", source: "", shortCircuit: true };
  if (!url.endsWith(".ts")) return next(url, context);
  const text = readFileSync(fileURLToPath(url), "utf8");
  const { outputText } = ts.transpileModule(text, { compilerOptions: { target: "ES2022", module: "ESNext", verbatimModuleSyntax: true } });
  return { format: "module", source: outputText, shortCircuit: true };
}
