// SPDX-License-Identifier: Apache-2.0
// Makes src/api/types.ts from the proto files: what protobuf JSON holds of each message, with the
// proto's own field names. Every field may be missing, as defaults are left out.
// The file is not kept in git: the build makes it, or `npm run types` for an editor.
// RIGCAL_PROTO_DIR: folder that holds rigcal/v1; by default that of the source tree.
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));
const target = join(here, 'src/api/types.ts');

/** Services whose messages the page uses; what they import comes with them. */
const roots = ['live_service', 'session_service', 'calibration_service', 'agent_service',
  'status_service', 'identity_service', 'camera_service', 'rig_service', 'lens_service'];

/** JSON type of a scalar; 64-bit integers are strings, bytes are base64. */
const scalars = {
  double: 'number', float: 'number', int32: 'number', uint32: 'number', sint32: 'number',
  fixed32: 'number', sfixed32: 'number', int64: 'string', uint64: 'string', sint64: 'string',
  fixed64: 'string', sfixed64: 'string', bool: 'boolean', string: 'string', bytes: 'string',
  'google.protobuf.Timestamp': 'string', 'google.protobuf.Duration': 'string',
};

/** The folder that holds rigcal/v1. */
export function protoFolder() {
  const candidates = [process.env.RIGCAL_PROTO_DIR, resolve(here, '../../proto')];
  const found = candidates.find((folder) => folder && existsSync(join(folder, 'rigcal/v1/live.proto')));
  if (!found) throw new Error('proto files not found: set RIGCAL_PROTO_DIR to the folder proto of the source tree');
  return found;
}

/** Messages and enums of one file: [{name, lines: TypeScript}], with names such as Session_State. */
function declarations(text, name) {
  const result = [];
  const stack = [];
  const full = (inner) => [...stack.map((block) => block.name), inner].join('_');
  for (const raw of text.split('\n')) {
    const line = raw.replace(/\/\/.*/, '').trim();
    if (line === '') continue;
    let match;
    if ((match = /^(message|enum|service) (\w+) \{(\})?$/.exec(line))) {
      const block = { kind: match[1], name: match[2], full: full(match[2]), members: [] };
      if (match[1] !== 'service') result.push(block);
      if (!match[3]) stack.push(block);
    } else if (line === '}') {
      stack.pop();
    } else if (stack.length > 0) {
      const block = stack.at(-1);
      if (block.kind === 'service' || /^(reserved|option)\b/.test(line)) continue;
      if (block.kind === 'enum') {
        match = /^(\w+) = \d+;$/.exec(line);
        if (!match) throw new Error(`${name}: cannot read "${line}"`);
        block.members.push(match[1]);
      } else {
        match = /^(repeated |optional )?([\w.]+) (\w+) = \d+( \[.*\])?;$/.exec(line);
        if (!match) throw new Error(`${name}: cannot read "${line}"`);
        block.members.push({ repeated: match[1] === 'repeated ', type: match[2], field: match[3],
          scope: stack.map((outer) => outer.name) });
      }
    }
  }
  return result;
}

/** The text of src/api/types.ts. */
export function makeTypes() {
  const folder = protoFolder();
  const files = new Set();
  const add = (file) => {
    if (files.has(file)) return;
    files.add(file);
    const text = readFileSync(join(folder, 'rigcal/v1', `${file}.proto`), 'utf8');
    for (const match of text.matchAll(/^import "rigcal\/v1\/(\w+)\.proto";$/gm)) add(match[1]);
  };
  roots.forEach(add);
  const blocks = [...files].sort().flatMap((file) =>
    declarations(readFileSync(join(folder, 'rigcal/v1', `${file}.proto`), 'utf8'), file));
  const known = new Set(blocks.map((block) => block.full));
  const typeOf = (member) => {
    if (scalars[member.type]) return scalars[member.type];
    const name = member.type.replaceAll('.', '_');
    for (let depth = member.scope.length; depth >= 0; --depth) {
      const candidate = [...member.scope.slice(0, depth), name].join('_');
      if (known.has(candidate)) return candidate;
    }
    throw new Error(`unknown type ${member.type} of ${member.scope.join('.')}.${member.field}`);
  };
  const out = ['// SPDX-License-Identifier: Apache-2.0',
    '// Made by proto_types.mjs from proto/rigcal/v1; do not edit. `npm run types` makes it anew.', ''];
  for (const block of blocks) {
    if (block.kind === 'enum') {
      out.push(`export type ${block.full} =`);
      block.members.forEach((value, i) =>
        out.push(`  | '${value}'${i + 1 === block.members.length ? ';' : ''}`));
    } else {
      out.push(`export interface ${block.full} {`);
      for (const member of block.members) {
        out.push(`  ${member.field}?: ${typeOf(member)}${member.repeated ? '[]' : ''};`);
      }
      out.push('}');
    }
    out.push('');
  }
  return out.join('\n');
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  mkdirSync(dirname(target), { recursive: true });
  writeFileSync(target, makeTypes());
}
