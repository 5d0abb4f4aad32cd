// SPDX-License-Identifier: Apache-2.0
// Start and stop, with the settings of a session.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { timeMs, toCount, toDuration } from '../api/json_values';
import { createCalibration, createSession, discardSession, resumeSession, startSession, stopSession } from '../api/server_api';
import type { Session } from '../api/types';
import { Chip, type Mark, Problem, WorkButton } from '../shell/parts';
import { hashOf } from '../shell/route';
import { changeSettings, readSettings } from '../shell/settings';
import type { RigState } from '../live/live_merge';
import { count, span } from '../view/format';
import { parseTarget, targetText } from '../view/target_text';

const states: Record<string, readonly [Mark, string]> = {
  STATE_CREATED: ['idle', 'created'], STATE_CAPTURING: ['live', 'capturing'], STATE_DRAINING: ['warn', 'draining'],
  STATE_FINISHED: ['good', 'finished'],
};

/** Symbol and word of a session's state. */
export function sessionState(session: Session | undefined): readonly [Mark, string] {
  if (session?.discard_time) return ['idle', 'thrown away'];
  return states[session?.state ?? ''] ?? ['idle', 'none'];
}

/** A number that may be left out; NaN where it is not one, or not positive. */
export function optionalPositive(text: string): number | undefined {
  const trimmed = text.trim().replace(',', '.');
  if (trimmed === '') return undefined;
  const value = Number(trimmed);
  return Number.isFinite(value) && value > 0 ? value : NaN;
}

/** Settings of the next session, and the button that starts it. */
function StartForm({ rig, onStarted }: { rig: RigState; onStarted: () => void }): JSX.Element {
  const stored = readSettings();
  const [target, setTarget] = useState(stored.target || targetText(rig.session?.target) || '0, 130, 390');
  const [untilMm, setUntilMm] = useState(stored.untilMm);
  const [minSeconds, setMinSeconds] = useState(stored.minSeconds);
  const [title, setTitle] = useState('');
  const [goOn, setGoOn] = useState(false);
  const [without, setWithout] = useState<ReadonlySet<string>>(new Set());
  const parsed = parseTarget(target);
  const until = optionalPositive(untilMm);
  const least = optionalPositive(minSeconds);
  const before = rig.session?.state === 'STATE_FINISHED' && !rig.session.discard_time ? rig.session : undefined;
  const usable = rig.cameras.filter((camera) => camera.state !== 'STATE_OFFLINE').map((camera) => camera.camera ?? '');
  const chosen = usable.filter((name) => !without.has(name));
  const start = async (): Promise<void> => {
    if (!parsed.target) throw new Error(parsed.problem);
    if (Number.isNaN(until)) throw new Error('The target error is a number of millimetres, or empty.');
    if (Number.isNaN(least)) throw new Error('The shortest time is a number of seconds, or empty.');
    changeSettings({ target, untilMm, minSeconds });
    const session = await createSession({ rig: rig.rig || undefined, title: title || undefined,
      target: goOn && before?.target ? before.target : parsed.target,
      goal: until ? { until_mm: until, ...(least ? { min_duration: toDuration(least) } : {}) } : undefined,
      // Without a choice those that are connected at the start take part.
      camera_names: chosen.length < usable.length ? chosen : undefined,
      continues: goOn ? before?.id : undefined });
    await startSession(session.id ?? '');
    onStarted();
  };
  return <div class="start">
    <div class="fields">
      <label class="wide">Markers along the wand, mm
        <input value={target} onInput={(event) => setTarget(event.currentTarget.value)} disabled={goOn}
          spellcheck={false} autocomplete="off" aria-invalid={!parsed.target} aria-describedby="target-problem" /></label>
      <label>Stop below, mm
        <input value={untilMm} inputMode="decimal" onInput={(event) => setUntilMm(event.currentTarget.value)}
          placeholder="by hand" aria-invalid={Number.isNaN(until)} /></label>
      <label>Not before, s
        <input value={minSeconds} inputMode="decimal" onInput={(event) => setMinSeconds(event.currentTarget.value)}
          placeholder="20" aria-invalid={Number.isNaN(least)} /></label>
      <label class="wide">Title
        <input value={title} maxLength={60} onInput={(event) => setTitle(event.currentTarget.value)} placeholder="optional" /></label>
      {before && <label class="check wide"><input type="checkbox" checked={goOn}
        onChange={(event) => setGoOn(event.currentTarget.checked)} /> Go on with {before.id}: its recording counts, too</label>}
    </div>
    {usable.length > 0 && <details class="cameras"><summary>Cameras: {chosen.length === usable.length ? `all ${usable.length}`
      : `${chosen.length} of ${usable.length}`}</summary>
      <div class="choices">{usable.map((name) => <label key={name} class="check"><input type="checkbox" checked={!without.has(name)}
        onChange={(event) => {
          const next = new Set(without);
          if (event.currentTarget.checked) next.delete(name);
          else next.add(name);
          setWithout(next);
        }} /> {name}</label>)}</div></details>}
    <div id="target-problem"><Problem text={goOn ? '' : parsed.problem} /></div>
    <WorkButton kind="primary" work={start} disabled={!parsed.target || chosen.length === 0}>Start capture</WorkButton>
    {usable.length > 0 && chosen.length === 0 && <p class="hint">No camera is chosen.</p>}
    {usable.length === 0 && <p class="hint">No camera is connected. <a href={hashOf('join')}>Connect a PC</a></p>}
  </div>;
}

/** The session of the rig: state, start, stop, and what follows. */
export function SessionControls({ rig, stale, onChange }: {
  rig: RigState; stale: boolean; onChange: () => void;
}): JSX.Element {
  const [again, setAgain] = useState(false);
  const session = rig.session;
  const [mark, word] = sessionState(session);
  const started = timeMs(session?.start_time);
  const ended = timeMs(session?.stop_time) ?? timeMs(rig.time);
  const running = session?.state === 'STATE_CAPTURING';
  const discarded = Boolean(session?.discard_time);
  const finished = session?.state === 'STATE_FINISHED' && !discarded;
  const settings = !session || discarded || again;
  return <div class="session">
    {session && <p class="line"><Chip mark={stale ? 'idle' : mark}>{stale ? 'not known' : word}</Chip>
      <span class="strong">{session.id}</span>{session.title && <span>{session.title}</span>}
      {started !== undefined && ended !== undefined && <span>{stale ? '' : span((ended - started) / 1000)}</span>}
      <span class="end">{count(toCount(session.wand_count))} with wand</span></p>}
    {session?.stop_reason && <p class="line">Stopped by itself: {session.stop_reason}.</p>}
    {running && <WorkButton kind="danger" work={async () => {
      setAgain(false);
      await stopSession(session.id ?? '');
      onChange();
    }}>■ Stop capture</WorkButton>}
    {session?.state === 'STATE_DRAINING' && <p class="hint">Waiting for what is still on its way from the agents.</p>}
    {session?.state === 'STATE_CREATED' && !discarded && !again && <div class="buttons"><WorkButton kind="primary" work={async () => {
      await startSession(session.id ?? '');
      onChange();
    }}>Start {session.id}</WorkButton></div>}
    {finished && !again && <div class="buttons">
      <WorkButton kind="primary" work={async () => {
        const calibration = await createCalibration([session.id ?? '']);
        location.hash = hashOf('result', calibration.id);
      }}>Calibrate</WorkButton>
      <WorkButton work={async () => {
        await resumeSession(session.id ?? '');
        onChange();
      }}>Resume</WorkButton>
      <button type="button" onClick={() => setAgain(true)}>New capture</button>
      <WorkButton kind="quiet" work={async () => {
        await discardSession(session.id ?? '');
        onChange();
      }}>Throw away</WorkButton>
    </div>}
    {discarded && <div class="buttons"><span class="hint">Nothing of it is deleted.</span>
      <WorkButton kind="quiet" work={async () => {
        await discardSession(session?.id ?? '', true);
        onChange();
      }}>Take it back</WorkButton></div>}
    {session?.state === 'STATE_CREATED' && !discarded && !again &&
      <button type="button" class="quiet" onClick={() => setAgain(true)}>Another session</button>}
    {settings && !running && <StartForm rig={rig} onStarted={() => {
      setAgain(false);
      onChange();
    }} />}
  </div>;
}
