// SPDX-License-Identifier: Apache-2.0
// For a phone beside the wand, or a screen four metres away.
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { createCalibration, createSession, resumeSession, startSession, stopSession } from '../api/server_api';
import { timeMs } from '../api/json_values';
import type { Calibration } from '../api/types';
import { gradeOf, hasEnded } from '../result/grade';
import { Activate } from '../result/activate';
import { useFeed, useFeedControl } from '../shell/feed_context';
import { WorkButton } from '../shell/parts';
import { hashOf } from '../shell/route';
import { changeSettings, readSettings } from '../shell/settings';
import { enumWords, millimetres, missing, span } from '../view/format';
import { targetOf } from '../view/target_text';
import { useCalibrationOf } from './calibration_of';
import { LiveFigureRegion } from './figure_region';
import { isCapturing, progressOf } from './progress';
import { nextSounds, nothingSaid, SoundPlayer } from './progress_sound';
import { NoCameras, optionalPositive, startFields, usableCameras } from './session_controls';

/** Keeps the screen on. Says whether it does. */
function useWakeLock(): boolean {
  const [held, setHeld] = useState(false);
  useEffect(() => {
    let lock: WakeLockSentinel | undefined;
    let gone = false;
    const take = async (): Promise<void> => {
      if (!('wakeLock' in navigator) || document.visibilityState !== 'visible') return;
      try {
        const taken = await navigator.wakeLock.request('screen');
        if (gone) {
          void taken.release();
          return;
        }
        lock = taken;
        taken.addEventListener('release', () => { if (!gone) setHeld(false); });
        setHeld(true);
      } catch {
        setHeld(false);
      }
    };
    void take();
    // The browser takes the lock away whenever the page is hidden.
    const again = () => void take();
    document.addEventListener('visibilitychange', again);
    return () => {
      gone = true;
      document.removeEventListener('visibilitychange', again);
      void lock?.release();
    };
  }, []);
  return held;
}

/** How far a calibration is, and its grade; in large letters. */
function CalibrationWords({ calibration }: { calibration: Calibration }): JSX.Element {
  const [mark, words] = gradeOf(calibration);
  const symbol = { good: '✓', warn: '▲', bad: '✕', idle: '…', info: '…', live: '…' }[mark];
  const stage = calibration.state === 'STATE_QUEUED' ? 'it waits for the worker' : enumWords(calibration.progress?.stage, 'CALIBRATION_STAGE_');
  const ended = hasEnded(calibration.state);
  return <section class={`verdict ${mark}`} aria-live="polite">
    <h1 class="word"><span aria-hidden="true">{symbol}</span> {ended ? words : 'Calibrating'}</h1>
    <p class="do">{ended ? calibration.error || (calibration.quality?.reasons ?? []).slice(0, 2).join('; ') : stage}</p>
    <p class="goal"><a href={hashOf('result', calibration.id)}>{calibration.id}: the whole result</a></p>
  </section>;
}

/** One word, one figure, one colour, what to do next. */
export function DistancePage(): JSX.Element {
  const control = useFeedControl();
  const { rig, stale, problem } = useFeed();
  const [settings, setSettings] = useState(readSettings());
  const player = useRef<SoundPlayer>();
  const said = useRef(nothingSaid);
  const awake = useWakeLock();
  useEffect(() => {
    control.setAttention('wave');
    return () => control.setAttention('other');
  }, [control]);
  useEffect(() => {
    player.current = new SoundPlayer();
    // Usually one comes here by a click, which is enough for the browser.
    player.current.unlock();
    const unlock = () => player.current?.unlock();
    document.addEventListener('pointerdown', unlock);
    document.addEventListener('keydown', unlock);
    return () => {
      document.removeEventListener('pointerdown', unlock);
      document.removeEventListener('keydown', unlock);
      player.current?.close();
      player.current = undefined;
    };
  }, []);
  const progress = progressOf(rig, stale);
  const capturing = isCapturing(rig);
  const need = rig.estimate?.state === 'STATE_WAITING' ? rig.estimate.needs?.[0] : undefined;
  const advice = need ? `where ${need.camera_a} and ${need.camera_b} both see it` : (rig.estimate?.advice?.[0]?.text ?? '');
  const alert = rig.alerts.find((one) => one.severity === 'SEVERITY_ERROR')?.text ?? '';
  useEffect(() => {
    const sounds = nextSounds(said.current, progress, capturing ? advice : '', alert, performance.now() / 1000);
    said.current = sounds.said;
    if (settings.beeps) player.current?.beep(sounds.tonesHz);
    if (settings.speech) player.current?.say(sounds.words);
  }, [progress.stage, progress.nowMm, advice, alert, capturing, settings]);
  const started = timeMs(rig.session?.start_time);
  const now = timeMs(rig.session?.stop_time ?? rig.session?.finish_time) ?? timeMs(rig.time);
  const start = async (): Promise<void> => {
    const { target, problem: refused } = targetOf(startFields(rig.session));
    if (!target) throw new Error(refused);
    const until = target.kind === 'KIND_RIGID' ? undefined : optionalPositive(settings.untilMm);
    const session = rig.session?.state === 'STATE_CREATED' ? rig.session
      : await createSession({ rig: rig.rig || undefined, target, goal: until ? { until_mm: until } : undefined });
    await startSession(session.id ?? '');
    control.retryNow();
  };
  const { calibration, lookAgain } = useCalibrationOf(rig.session);
  const finished = rig.session?.state === 'STATE_FINISHED' && !rig.session.discard_time;
  const draining = rig.session?.state === 'STATE_DRAINING';
  const cameras = usableCameras(rig).length > 0;
  const solving = calibration?.state === 'STATE_QUEUED' || calibration?.state === 'STATE_RUNNING';
  const again = cameras && <>
    <WorkButton work={async () => {
      await resumeSession(rig.session?.id ?? '');
      control.retryNow();
    }} disabled={stale || solving}>Wave on</WorkButton>
    <WorkButton work={start} disabled={stale || solving}>New capture</WorkButton></>;
  const toggle = (name: 'beeps' | 'speech') => setSettings(changeSettings({ [name]: !settings[name] }));
  const tone = finished && calibration && !stale ? `verdict-${gradeOf(calibration)[0]}` : `stage-${progress.stage}`;
  return <main id="main" class={`distance ${tone}`} tabIndex={-1}>
    <header>
      <a class="button" href={hashOf('wave')}>← Back</a>
      <button type="button" aria-pressed={settings.beeps} onClick={() => toggle('beeps')}>{settings.beeps ? '♪ Beeps on' : '♪ Beeps off'}</button>
      <button type="button" aria-pressed={settings.speech} onClick={() => toggle('speech')}>{settings.speech ? '❝ Voice on' : '❝ Voice off'}</button>
      <span class="hint">{awake ? 'Screen stays on' : 'Screen may turn off'}</span>
    </header>
    {finished && calibration && !stale ? <CalibrationWords calibration={calibration} /> : <>
    <h1 class="word"><span aria-hidden="true">{progress.symbol}</span> {progress.word}</h1>
    <p class={`huge${millimetres(progress.nowMm).length > 4 ? ' long' : ''}`}><span class="digits">{stale ? missing : millimetres(progress.nowMm)}</span><span class="unit">mm</span></p>
    <LiveFigureRegion progress={progress} />
    <p class="goal">{[progress.goalMm === undefined ? '' : `goal ${millimetres(progress.goalMm)} mm`,
      started !== undefined && now !== undefined && !stale ? span((now - started) / 1000) : ''].filter(Boolean).join(' · ')}</p>
    <p class="do">{stale ? `${problem || 'The server does not answer.'} Last data ${span(control.ageMs() / 1000)} ago.`
      : capturing && advice !== '' ? `Wave ${advice}` : draining ? 'The last observations are on their way.' : rig.session?.stop_reason ?? ''}</p>
    </>}
    {!stale && alert !== '' && <p class="wrong">✕ {alert}</p>}
    <footer>{capturing
      ? <WorkButton kind="danger" disabled={stale} work={async () => {
        await stopSession(rig.session?.id ?? '');
        control.retryNow();
      }}>■ Stop</WorkButton>
      : (finished || draining) && calibration?.state !== 'STATE_SUCCEEDED'
        ? <><WorkButton kind="primary" disabled={stale || draining || solving} work={async () => {
          await createCalibration([rig.session?.id ?? '']);
          lookAgain();
        }}>{solving ? 'Calibrating …' : 'Calibrate'}</WorkButton>
        {finished && <div class="others">{again}</div>}</>
        : finished && calibration ? <><Activate calibration={calibration} disabled={stale} />
          <div class="others"><a class="button" href={hashOf('result', calibration.id)}>Floor, downloads</a>{again}</div></>
          : cameras ? <WorkButton kind="primary" work={start} disabled={stale}>Start</WorkButton>
            : !stale && <NoCameras />}</footer>
  </main>;
}
