// SPDX-License-Identifier: Apache-2.0
// The detector of one camera: a mask and the wand's colour learnt on the running agent, or set by hand.
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { clearMask, getDetector, learnMask, setDetectorColour, tuneDetector } from '../api/server_api';
import type { ColourRange, Detector, DetectorLearning } from '../api/types';
import { Meter, Problem, WorkButton } from '../shell/parts';
import { useLoaded } from '../shell/use_async';
import { count, fixed, missing, percent } from '../view/format';

type ColourField = keyof ColourRange;
const colourFields: { field: ColourField; label: string; max: number; step: number }[] = [
  { field: 'hue_min_deg', label: 'Hue from, degrees', max: 360, step: 1 },
  { field: 'hue_max_deg', label: 'Hue to, degrees', max: 360, step: 1 },
  { field: 'saturation_min', label: 'Saturation from, 0 to 1', max: 1, step: 0.01 },
  { field: 'value_min', label: 'Brightness from, 1 to 255', max: 255, step: 1 },
  { field: 'washed_out_min', label: 'White from (256: never)', max: 256, step: 1 },
];

/** Hues from one to the other, as a band of colour. */
function HueBand({ colour }: { colour: ColourRange }): JSX.Element {
  const from = colour.hue_min_deg ?? 0;
  const width = ((colour.hue_max_deg ?? 0) - from + 360) % 360 || 360;
  const stops = Array.from({ length: 9 }, (_, i) => `hsl(${(from + width * i / 8) % 360} 85% 50%)`);
  return <span class="hueband" aria-hidden="true" style={{ background: `linear-gradient(90deg, ${stops.join(', ')})` }} />;
}

function Learning({ learning }: { learning: DetectorLearning }): JSX.Element {
  const what = learning.kind === 'KIND_COLOUR' ? 'colour' : 'mask';
  if (learning.state === 'STATE_RUNNING') {
    const [done, all] = [learning.frame_count ?? 0, learning.wanted_frame_count ?? 1];
    return <div class="learning">
      <Meter share={done / all} label={`Learning the ${what}`} />
      <p>● Learning the {what}: {done} of {all} frames, {learning.wand_count ?? 0} with the wand</p>
    </div>;
  }
  const good = learning.state === 'STATE_SUCCEEDED';
  return <p class={good ? 'learnt' : 'problem'}>{good ? `✓ The ${what} is in use: ` : `✕ No ${what}: `}{learning.message}</p>;
}

function ColourForm({ detector, onSet, busy }: {
  detector: Detector; onSet: (colour: ColourRange | undefined) => Promise<void>; busy: boolean;
}): JSX.Element {
  const [typed, setTyped] = useState<Partial<Record<ColourField, string>>>({});
  const now = detector.colour ?? {};
  const value = (field: ColourField): string => typed[field] ?? String(Number(fixed(now[field] ?? 0, 3)));
  const wrong = (field: ColourField, max: number): boolean => {
    const number = Number(value(field));
    return value(field).trim() === '' || !(number >= 0 && number <= max);
  };
  const wanted = (): ColourRange => Object.fromEntries(colourFields.map(({ field }) => [field, Number(value(field))]));
  return <details>
    <summary>Colour by hand</summary>
    <div class="fields">
      {colourFields.map(({ field, label, max, step }) => <label key={field}>{label}
        <input type="number" min={0} max={max} step={step} value={value(field)} aria-invalid={wrong(field, max)}
          onInput={(event) => setTyped({ ...typed, [field]: event.currentTarget.value })} />
      </label>)}
    </div>
    <div class="buttons">
      <WorkButton disabled={busy || colourFields.some(({ field, max }) => wrong(field, max))} work={async () => {
        await onSet(wanted());
        setTyped({});
      }}>Use this colour</WorkButton>
      {detector.colour_learnt && <WorkButton disabled={busy} work={async () => {
        await onSet(undefined);
        setTyped({});
      }}>Back to the agent's configuration</WorkButton>}
    </div>
  </details>;
}

/** Shows the detector of a camera and changes it; asks the agent while it is open. */
export function DetectorDialog({ rig, camera, onClose }: { rig: string; camera: string; onClose: () => void }): JSX.Element {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  const [running, setRunning] = useState(false);
  const loaded = useLoaded(`detector ${rig}/${camera}`, (signal) => getDetector(rig, camera, signal), running ? 500 : 3000);
  const detector = loaded.value;
  const learning = detector?.learning;
  const busy = learning?.state === 'STATE_RUNNING';
  useEffect(() => setRunning(busy), [busy]);
  const act = (call: () => Promise<Detector>) => async (): Promise<void> => {
    await call();
    loaded.reload();
  };
  const colour = detector?.colour;
  return <dialog ref={dialog} class="detector" onClose={onClose} aria-labelledby="detector-title">
    <h2 id="detector-title">Detector of {camera}</h2>
    <Problem text={loaded.problem} />
    {detector && <>
      <dl class="facts">
        <div class="fact"><dt>colour</dt><dd>{colour ? <><HueBand colour={colour} /> {fixed(colour.hue_min_deg ?? 0, 0)}° to {fixed(colour.hue_max_deg ?? 0, 0)}°,
          brightness from {colour.value_min ?? 0}</> : missing}</dd></div>
        <div class="fact"><dt>from</dt><dd>{detector.colour_learnt ? 'tuned or set here' : "the agent's configuration"}</dd></div>
        <div class="fact"><dt>ignored</dt><dd>{count(detector.ignored_pixel_count ?? 0)} pixels, {percent(detector.ignored_share ?? 0, 2)}{detector.mask_learnt ? ', mask learnt here' : ''}</dd></div>
      </dl>
      <div role="status">{learning && <Learning learning={learning} />}</div>
      <p class="hint"><b>Mask:</b> keep the wand out of view, or moving; static bright spots are ignored from then on.
        {' '}<b>Tune:</b> show the wand, near and far. Both need a session that captures.</p>
      <div class="buttons start">
        <WorkButton kind="primary" disabled={busy} work={act(() => learnMask(rig, camera))}>Learn mask</WorkButton>
        <WorkButton kind="primary" disabled={busy} work={act(() => tuneDetector(rig, camera))}>Tune colour</WorkButton>
        {detector.mask_learnt && <WorkButton disabled={busy} work={act(() => clearMask(rig, camera))}>Forget mask</WorkButton>}
      </div>
      <ColourForm detector={detector} busy={busy} onSet={(wanted) => act(() => setDetectorColour(rig, camera, wanted))()} />
    </>}
    {!detector && loaded.loading && <p class="empty">The agent is asked…</p>}
    <div class="buttons"><button type="button" onClick={() => dialog.current?.close()}>Close</button></div>
  </dialog>;
}
