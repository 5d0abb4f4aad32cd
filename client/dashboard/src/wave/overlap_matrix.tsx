// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import type { LiveCamera, LiveOverlap } from '../api/types';
import { Meter } from '../shell/parts';
import { count } from '../view/format';
import { overlapStep } from '../view/colour_scale';
import { memo } from './memo';

/** Instants of a pair (i < j) in the packed list. */
export function overlapCount(overlap: LiveOverlap, i: number, j: number): number {
  const n = overlap.cameras?.length ?? 0;
  const [a, b] = i < j ? [i, j] : [j, i];
  return overlap.counts?.[a * n - (a * (a + 1)) / 2 + (b - a - 1)] ?? 0;
}

/** Of more cameras nobody can read a matrix. */
export const mostInMatrix = 40;
/** So many cameras are listed instead. */
const mostListed = 12;

const words = ['none', 'too few', 'some', 'good'] as const;

/** Which pairs of cameras have seen the wand together, and how often. */
export const OverlapMatrix = memo(function OverlapMatrix({ overlap }: { overlap: LiveOverlap | undefined }): JSX.Element {
  const cameras = overlap?.cameras ?? [];
  if (!overlap || cameras.length < 2) return <p class="empty">Shown once two cameras take part.</p>;
  return <>
    <div class="scroll" tabIndex={0} role="region" aria-label="Instants that pairs of cameras have in common">
      <table class="matrix">
        <caption class="hidden">Instants that pairs of cameras have in common</caption>
        <thead><tr><td />{cameras.slice(0, -1).map((name) => <th scope="col" key={name}><span>{name}</span></th>)}</tr></thead>
        <tbody>{cameras.slice(1).map((row, r) => <tr key={row}>
          <th scope="row">{row}</th>
          {cameras.slice(0, r + 1).map((column, c) => {
            const value = overlapCount(overlap, r + 1, c);
            return <td key={column} class={`step${overlapStep(value)}`}
              title={`${row} and ${column}: ${value} instants (${words[overlapStep(value)]})`}>{count(value)}</td>;
          })}
        </tr>)}</tbody>
      </table>
    </div>
    <p class="legend" aria-hidden="true"><span class="step0">0</span> none <span class="step1">1</span> too few
      <span class="step2">50</span> some <span class="step3">200</span> good</p>
  </>;
});

/** The cameras of a large rig that have seen the wand least together with others. */
export const LeastShared = memo(function LeastShared({ cameras }: { cameras: readonly LiveCamera[] }): JSX.Element {
  const part = (camera: LiveCamera): number => (camera.shared_instant_count ?? 0) / (camera.shared_instant_goal ?? 1);
  const least = cameras.filter((camera) => (camera.shared_instant_goal ?? 0) > 0 && part(camera) < 1)
    .sort((a, b) => part(a) - part(b)).slice(0, mostListed);
  if (least.length === 0) return <p class="empty">No camera needs more instants together with others.</p>;
  return <ol class="leastshared">{least.map((camera) => <li key={camera.camera}>
    <span class="name">{camera.camera}</span><Meter share={part(camera)} label={`${camera.camera}: shared instants`} />
    <span class="numbers">{count(camera.shared_instant_count ?? 0)}/{count(camera.shared_instant_goal ?? 0)}</span></li>)}</ol>;
});
