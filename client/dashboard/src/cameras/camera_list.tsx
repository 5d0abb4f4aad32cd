// SPDX-License-Identifier: Apache-2.0
import type { ComponentChildren, JSX } from 'preact';
import { useState } from 'preact/hooks';
import { Chip } from '../shell/parts';
import { count } from '../view/format';
import { cameraState } from '../wave/camera_tile';
import type { CameraNeed } from './camera_needs';

/** A field for a part of a name, an agent or a need. */
export function SearchField({ text, label, onChange }: { text: string; label: string; onChange: (text: string) => void }): JSX.Element {
  return <label class="search">{label}<input type="search" value={text} autocomplete="off" spellcheck={false}
    onInput={(event) => onChange(event.currentTarget.value)} /></label>;
}

/** The first of many, and a button for more of them. */
export function FirstOf<Item>({ items, step, children }: {
  items: readonly Item[]; step: number; children: (shown: readonly Item[]) => ComponentChildren;
}): JSX.Element {
  const [limit, setLimit] = useState(step);
  const left = items.length - limit;
  return <>
    {children(items.slice(0, limit))}
    {left > 0 && <button type="button" class="more" onClick={() => setLimit(limit + 4 * step)}>Show more ({count(left)} left)</button>}
  </>;
}

/** Cameras of a large rig, each in one line: those that need something first. */
export function CameraList({ needs, chosen, stale, onChoose }: {
  needs: readonly CameraNeed[]; chosen: string; stale: boolean; onChoose: (name: string) => void;
}): JSX.Element {
  if (needs.length === 0) return <p class="empty">No camera has this in its name, its agent or what it needs.</p>;
  return <FirstOf items={needs} step={12}>{(shown) => <ul class="cameralist">{shown.map((need) => {
    const word = need.why === '' ? cameraState(need.camera)[1] : { bad: 'error', warn: 'warning' }[need.mark as string] ?? 'note';
    return <li key={need.name}><button type="button" class="quiet" aria-pressed={need.name === chosen}
      onClick={() => onChoose(need.name === chosen ? '' : need.name)}>
      <span class="name">{need.name}</span>
      <Chip mark={stale ? 'idle' : need.mark}>{stale ? 'not known' : word}</Chip>
      {!stale && need.why !== '' && <span class="why">{need.why}</span>}
    </button></li>;
  })}</ul>}</FirstOf>;
}
