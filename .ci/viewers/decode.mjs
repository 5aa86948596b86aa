// Proves that a log decodes with Foxglove's own parser: every message, and as many as it says.
//
// Usage: node decode.mjs LOG.mcap

import { decoder, records, withIndex } from "./log.mjs";

const path = process.argv[2];
try {
  console.log(await decoded(path));
} catch (error) {
  console.error(`${path}: ${error.message}`);
  process.exit(1);
}

async function decoded(path) {
  const counts = await decodeIndexed(path);
  // The indexed reader sees only what the index names; this pass sees what the file holds.
  const held = new Map();
  for await (const record of records(path)) {
    if (record.type === "Message") {
      count(held, record.channelId);
    }
  }
  const total = agree(held, counts, "the data section holds");
  return `${total} messages on ${counts.size} channels decode, as many as the statistics say`;
}

/** Decodes every message that the index leads to, and returns the statistics' counts. */
async function decodeIndexed(path) {
  return await withIndex(path, async (log) => {
    if (!log.statistics) {
      throw new Error("expected a statistics record, got none");
    }
    const topics = [...log.channelsById.values()].map((channel) => channel.topic);
    if (!topics.includes("/joint_states")) {
      throw new Error(`expected a topic /joint_states, got ${topics.sort().join(", ")}`);
    }
    const decoders = new Map();
    for (const channel of log.channelsById.values()) {
      decoders.set(channel.id, decoder(channel, log.schemasById.get(channel.schemaId)));
    }
    const seen = new Map();
    for await (const message of log.readMessages({ validateCrcs: true })) {
      const value = decoders.get(message.channelId)(message);
      if (log.channelsById.get(message.channelId).topic === "/joint_states") {
        checkJoints(value, message.sequence);
      }
      count(seen, message.channelId);
    }
    const stated = log.statistics.channelMessageCounts;
    const total = agree(seen, stated, "the index leads to");
    if (BigInt(total) !== log.statistics.messageCount) {
      throw new Error(`the statistics say ${log.statistics.messageCount} messages, got ${total}`);
    }
    return stated;
  });
}

/** Checks that what a viewer plots is there: a finite number for each joint. */
function checkJoints(state, sequence) {
  for (const field of ["position", "velocity", "effort"]) {
    const numbers = state[field];
    if (!(numbers instanceof Float64Array) || numbers.length !== state.name.length) {
      throw new Error(
        `/joint_states: message ${sequence} names ${state.name.length} joints, ` +
          `expected as many float64 of ${field}, got ${numbers?.length ?? "none"}`,
      );
    }
    const strange = numbers.find((number) => !Number.isFinite(number));
    if (strange !== undefined) {
      throw new Error(
        `/joint_states: message ${sequence}: expected finite numbers of ${field}, got ${strange}`,
      );
    }
  }
}

function count(counts, id) {
  counts.set(id, (counts.get(id) ?? 0) + 1);
}

/** Returns how many messages there are, where each channel has as many as the statistics say. */
function agree(seen, stated, where) {
  for (const id of new Set([...seen.keys(), ...stated.keys()])) {
    const [got, expected] = [seen.get(id) ?? 0, stated.get(id) ?? 0n];
    if (BigInt(got) !== expected) {
      throw new Error(`channel ${id}: the statistics say ${expected} messages, ${where} ${got}`);
    }
  }
  return [...seen.values()].reduce((sum, number) => sum + number, 0);
}
