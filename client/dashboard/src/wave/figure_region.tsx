// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useRef } from 'preact/hooks';
import { millimetres } from '../view/format';
import type { Progress } from './progress';

/** Tells a screen reader the state at once, and the figure when it has changed by a tenth. */
export function LiveFigureRegion({ progress }: { progress: Progress }): JSX.Element {
  const said = useRef<{ text: string; mm: number | undefined; stage: string }>({ text: '', mm: undefined, stage: '' });
  const { nowMm, stage } = progress;
  const before = said.current;
  const moved = nowMm !== undefined && (before.mm === undefined || Math.abs(Math.log(nowMm / before.mm)) > 0.1);
  if (stage !== before.stage || moved) {
    const figure = nowMm === undefined || stage === 'stale' ? '' : `, expected error ${millimetres(nowMm)} millimetres`;
    said.current = { text: `${progress.word}${figure}`, mm: nowMm, stage };
  }
  return <p class="hidden" aria-live="polite">{said.current.text}</p>;
}
