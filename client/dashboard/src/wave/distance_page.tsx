// SPDX-License-Identifier: Apache-2.0
// For a phone beside the wand, or a screen four metres away.
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { createSession, startSession, stopSession } from '../api/server_api';
import { timeMs } from '../api/json_values';
import { useFeed, useFeedControl } from '../shell/feed_context';
import { WorkButton } from '../shell/parts';
import { hashOf } from '../shell/route';
import { changeSettings, readSettings } from '../shell/settings';
import { millimetres, missing, span } from '../view/format';
import { parseTarget, targetText } from '../view/target_text';
import { LiveFigureRegion } from './figure_region';
import { isCapturing, progressOf } from './progress';
import { nextSounds, nothingSaid, SoundPlayer } from './progress_sound';

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
  const now = timeMs(rig.session?.stop_time) ?? timeMs(rig.time);
  const start = async (): Promise<void> => {
    const text = settings.target || targetText(rig.session?.target) || '0, 130, 390';
    const { target, problem: refused } = parseTarget(text);
    if (!target) throw new Error(refused);
    const until = Number(settings.untilMm);
    const session = rig.session?.state === 'STATE_CREATED' ? rig.session
      : await createSession({ rig: rig.rig || undefined, target, goal: until > 0 ? { until_mm: until } : undefined });
    await startSession(session.id ?? '');
    control.retryNow();
  };
  const toggle = (name: 'beeps' | 'speech') => setSettings(changeSettings({ [name]: !settings[name] }));
  return <main id="main" class={`distance stage-${progress.stage}`} tabIndex={-1}>
    <header>
      <a class="button" href={hashOf('wave')}>← Back</a>
      <button type="button" aria-pressed={settings.beeps} onClick={() => toggle('beeps')}>{settings.beeps ? '♪ Beeps on' : '♪ Beeps off'}</button>
      <button type="button" aria-pressed={settings.speech} onClick={() => toggle('speech')}>{settings.speech ? '❝ Voice on' : '❝ Voice off'}</button>
      <span class="hint">{awake ? 'Screen stays on' : 'Screen may turn off'}</span>
    </header>
    <h1 class="word"><span aria-hidden="true">{progress.symbol}</span> {progress.word}</h1>
    <p class={`huge${millimetres(progress.nowMm).length > 4 ? ' long' : ''}`}><span class="digits">{stale ? missing : millimetres(progress.nowMm)}</span><span class="unit">mm</span></p>
    <LiveFigureRegion progress={progress} />
    <p class="goal">{[progress.targetMm === undefined ? '' : `target ${millimetres(progress.targetMm)} mm`,
      started !== undefined && now !== undefined && !stale ? span((now - started) / 1000) : ''].filter(Boolean).join(' · ')}</p>
    <p class="do">{stale ? `${problem || 'The server does not answer.'} Last data ${span(control.ageMs() / 1000)} ago.`
      : capturing && advice !== '' ? `Wave ${advice}` : rig.session?.stop_reason ?? ''}</p>
    {!stale && alert !== '' && <p class="wrong">✕ {alert}</p>}
    <footer>{capturing
      ? <WorkButton kind="danger" work={async () => {
        await stopSession(rig.session?.id ?? '');
        control.retryNow();
      }}>■ Stop</WorkButton>
      : <WorkButton kind="primary" work={start} disabled={stale || rig.session?.state === 'STATE_DRAINING'}>Start</WorkButton>}</footer>
  </main>;
}
