// Proves that a Foxglove layout fits a log: every topic, frame and message path of it is there.
//
// Usage: node layout.mjs LAYOUT.json LOG.mcap
//
// Foxglove's own parser of message paths is not published. This one knows the part of the syntax
// that the layout uses, /topic.field.field[3], and refuses the rest.

import { readFile } from "node:fs/promises";

import { decoder, withIndex } from "./log.mjs";

const PATH = /^(?<topic>(\/\w+)+)(?<steps>(\.\w+|\[\d+\])*)$/;

const [layoutPath, logPath] = process.argv.slice(2);
try {
  const layout = JSON.parse(await readFile(layoutPath, "utf8"));
  const messages = await firstMessages(logPath);
  checkArrangement(layout);
  let found = 0;
  for (const [id, config] of Object.entries(layout.configById)) {
    found += checkPanel(id, config, messages);
  }
  console.log(`${found} topics, frames and message paths of the layout are in ${logPath}`);
} catch (error) {
  console.error(`${layoutPath}: ${error.message}`);
  process.exit(1);
}

/** Returns the first message of each topic. */
async function firstMessages(path) {
  return await withIndex(path, async (log) => {
    const messages = new Map();
    for await (const message of log.readMessages()) {
      const channel = log.channelsById.get(message.channelId);
      if (!messages.has(channel.topic)) {
        const decode = decoder(channel, log.schemasById.get(channel.schemaId));
        messages.set(channel.topic, decode(message));
      }
      if (messages.size === log.channelsById.size) {
        break;
      }
    }
    return messages;
  });
}

/** Checks that the panels that are arranged are the panels that are configured. */
function checkArrangement({ layout, configById }) {
  const arranged = panels(layout).sort().join(", ");
  const configured = Object.keys(configById).sort().join(", ");
  if (arranged !== configured) {
    throw new Error(`expected the panels ${configured} to be arranged, got ${arranged}`);
  }
}

function panels(node) {
  return typeof node === "string" ? [node] : [...panels(node.first), ...panels(node.second)];
}

/** Checks one panel, and returns how many names of it were looked up. */
function checkPanel(id, config, messages) {
  const type = id.split("!")[0];
  switch (type) {
    case "3D":
      return checkScene(id, config, messages);
    case "Plot":
      for (const { value, label } of config.paths) {
        checkSeries(id, value, label, messages);
      }
      return config.paths.length;
    case "RawMessages":
      resolve(id, config.topicPath, messages);
      return 1;
    default:
      throw new Error(`${id}: this check knows no panel ${type}: say here where its paths are`);
  }
}

function checkScene(id, config, messages) {
  const layers = Object.values(config.layers);
  const topics = Object.keys(config.topics).concat(layers.flatMap((layer) => layer.topic ?? []));
  for (const topic of topics) {
    resolve(id, topic, messages);
  }
  const transforms = resolve(id, "/tf", messages).message.transforms;
  const known = transforms.flatMap((t) => [t.header.frame_id, t.child_frame_id]);
  const frames = [config.fixedFrame, config.followTf, ...layers.flatMap((l) => l.frameId ?? [])];
  for (const frame of frames) {
    if (!known.includes(frame)) {
      throw new Error(`${id}: expected a frame of /tf (${[...new Set(known)]}), got ${frame}`);
    }
  }
  return topics.length + frames.length;
}

/** Checks that a series is a number, and, of messages that name their numbers, the one it says. */
function checkSeries(id, path, label, messages) {
  const { message, value, index } = resolve(id, path, messages);
  if (typeof value !== "number") {
    throw new Error(`${id}: expected ${path} to be a number, got ${typeof value}`);
  }
  const name = message.name?.[index];
  if (name !== undefined && label.split(" ")[0] !== name) {
    throw new Error(`${id}: ${path} is of ${name}, and its label says ${label}`);
  }
}

/** Returns what a path leads to, the message it starts from and the last index it takes. */
function resolve(id, path, messages) {
  const parts = PATH.exec(path)?.groups;
  if (!parts) {
    throw new Error(`${id}: expected a path like /topic.field[3], got ${path}`);
  }
  const message = messages.get(parts.topic);
  if (message === undefined) {
    const topics = [...messages.keys()].sort().join(", ");
    throw new Error(`${id}: expected a topic of the log (${topics}), got ${path}`);
  }
  let value = message;
  let index;
  for (const [step] of parts.steps.matchAll(/\w+/g)) {
    const inside = typeof value === "object" ? Object.keys(value) : [];
    if (!inside.includes(step)) {
      throw new Error(`${id}: ${path} leads nowhere at ${step}: there is ${inside.join(", ")}`);
    }
    index = /^\d+$/.test(step) ? Number(step) : undefined;
    value = value[step];
  }
  return { message, value, index };
}
