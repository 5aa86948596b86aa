// A log as other people's tools read it: MCAP's own reader for TypeScript, Foxglove's own parsers.

import { open, readFile } from "node:fs/promises";

import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers } from "@mcap/support";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";

const decompressHandlers = await loadDecompressHandlers();

/** Yields every record of a file from its first byte to its last, each checksum verified. */
export async function* records(path) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(await readFile(path));
  for (let record; (record = reader.nextRecord()); ) {
    yield record;
  }
  if (!reader.done()) {
    throw new Error("expected a whole file, got one that ends in the middle: it was cut short");
  }
}

/** Calls `use` with the indexed reader of a file, which is how a viewer reads it. */
export async function withIndex(path, use) {
  const file = await open(path);
  try {
    const readable = new FileHandleReadable(file);
    return await use(await McapIndexedReader.Initialize({ readable, decompressHandlers }));
  } finally {
    await file.close();
  }
}

/** Returns a function that decodes a channel's message by the schema that the file embeds. */
export function decoder(channel, schema) {
  if (channel.messageEncoding !== "cdr" || schema?.encoding !== "ros2msg") {
    throw new Error(
      `${channel.topic}: expected cdr messages with a ros2msg schema, ` +
        `got ${channel.messageEncoding} with ${schema?.encoding ?? "none"}`,
    );
  }
  const text = new TextDecoder().decode(schema.data);
  const reader = new MessageReader(parse(text, { ros2: true }));
  return (message) => {
    let value;
    try {
      value = reader.readMessage(message.data);
    } catch (error) {
      throw new Error(
        `${channel.topic}: message ${message.sequence} is no ${schema.name}: ${error.message}`,
      );
    }
    if (reader.lastReadHadTrailingBytes()) {
      throw new Error(
        `${channel.topic}: message ${message.sequence} is no ${schema.name}: it has ` +
          `${message.data.byteLength} bytes, and its schema accounts for ${reader.lastReadByteLength()}`,
      );
    }
    return value;
  };
}
