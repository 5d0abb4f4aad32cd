// SPDX-License-Identifier: Apache-2.0
// What is beeped and spoken while somebody waves far from the screen.
import type { Progress } from './progress';

/** What was last said. */
export interface Said {
  figureMm: number | undefined;
  beepedFigureMm: number | undefined;
  advice: string;
  adviceAtS: number;
  stage: Progress['stage'];
  alert: string;
}

/** Nothing was said. */
export const nothingSaid: Said = { figureMm: undefined, beepedFigureMm: undefined, advice: '', adviceAtS: -Infinity,
  stage: 'no_session', alert: '' };

/** Tones of a beep one after the other, hertz, and words. */
export interface Sounds {
  tonesHz: number[];
  words: string[];
  said: Said;
}

const spokenFigure = (mm: number): string =>
  `${mm < 1 ? mm.toFixed(2) : mm < 10 ? mm.toFixed(1) : mm.toFixed(0)} millimetres`;

/** What to beep and say now. One beep per new figure, higher the better it is; a figure is spoken
 * when it has fallen by a sixth, advice when it changes but every 8 s at most. */
export function nextSounds(said: Said, progress: Progress, advice: string, alert: string, timeS: number): Sounds {
  const next = { ...said, stage: progress.stage };
  const tonesHz: number[] = [];
  const words: string[] = [];
  const entered = (stage: Progress['stage']) => progress.stage === stage && said.stage !== stage;
  if (entered('reached')) {
    tonesHz.push(660, 880, 1320);
    words.push(progress.nowMm === undefined ? 'Good enough.' : `Good enough. ${spokenFigure(progress.nowMm)}.`);
  } else if (entered('stale')) {
    tonesHz.push(220, 196);
    words.push('No data from the server.');
  } else if (['waving', 'near'].includes(progress.stage) && progress.nowMm !== undefined) {
    if (progress.nowMm !== said.beepedFigureMm) {
      tonesHz.push(Math.round(330 * 2 ** (1.6 * progress.quality)));
      next.beepedFigureMm = progress.nowMm;
    }
    if (said.figureMm === undefined || progress.nowMm < said.figureMm * 0.84) {
      words.push(`${spokenFigure(progress.nowMm)}.`);
      next.figureMm = progress.nowMm;
    }
  }
  if (alert !== '' && alert !== said.alert && progress.stage !== 'stale') {
    tonesHz.push(262, 262);
    words.push(alert);
  }
  next.alert = alert;
  const capturing = ['waving', 'near', 'waiting'].includes(progress.stage);
  if (capturing && advice !== '' && advice !== said.advice && timeS - said.adviceAtS >= 8) {
    words.push(`Wave ${advice}.`);
    next.advice = advice;
    next.adviceAtS = timeS;
  }
  if (entered('waiting')) {
    next.figureMm = undefined;
    next.beepedFigureMm = undefined;
  }
  return { tonesHz, words, said: next };
}

/** Plays tones and words in the browser. */
export class SoundPlayer {
  private audio: AudioContext | undefined;

  /** To be called by a click first: browsers play nothing before. */
  unlock(): void {
    if (!('AudioContext' in globalThis)) return;
    this.audio ??= new AudioContext();
    // Refused before a click, and where the page is left at once; then there is no sound.
    this.audio.resume().catch(() => undefined);
  }

  beep(tonesHz: readonly number[]): void {
    const audio = this.audio;
    if (!audio || audio.state !== 'running') return;
    tonesHz.forEach((frequency, i) => {
      const start = audio.currentTime + i * 0.16;
      const tone = audio.createOscillator();
      const volume = audio.createGain();
      tone.frequency.value = frequency;
      volume.gain.setValueAtTime(0, start);
      volume.gain.linearRampToValueAtTime(0.25, start + 0.01);
      volume.gain.exponentialRampToValueAtTime(0.001, start + 0.14);
      tone.connect(volume).connect(audio.destination);
      tone.start(start);
      tone.stop(start + 0.15);
    });
  }

  say(words: readonly string[]): void {
    if (words.length === 0 || !('speechSynthesis' in globalThis)) return;
    // What is said late is of no use.
    speechSynthesis.cancel();
    const speech = new SpeechSynthesisUtterance(words.join(' ').replaceAll('_', ' '));
    speech.lang = 'en';
    speechSynthesis.speak(speech);
  }

  close(): void {
    if ('speechSynthesis' in globalThis) speechSynthesis.cancel();
    void this.audio?.close();
    this.audio = undefined;
  }
}
