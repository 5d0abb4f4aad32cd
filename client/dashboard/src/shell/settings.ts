// SPDX-License-Identifier: Apache-2.0
// What this browser remembers. Works without storage, too.

/** Settings of this browser. */
export interface Settings {
  theme: 'dark' | 'light';
  /** Beeps in the distance mode. */
  beeps: boolean;
  /** Spoken advice in the distance mode. */
  speech: boolean;
  rig: string;
  /** The target of the last session that was started here, as fields; empty: none was. */
  targetKind: string;
  markers: string;
  diameter: string;
  blinkHz: string;
  tolerance: string;
  points: string;
  board: string;
  untilMm: string;
  minSeconds: string;
  scene: '3d' | 'plan';
  /** Pictures of the cameras on the Wave page. */
  pictures: boolean;
}

const defaults: Settings = {
  theme: 'dark', beeps: true, speech: false, rig: '', targetKind: '', markers: '', diameter: '', blinkHz: '',
  tolerance: '', points: '', board: '', untilMm: '0.5', minSeconds: '20', scene: '3d', pictures: true,
};
const key = 'rigcal';

/** What was remembered; defaults for the rest. */
export function readSettings(): Settings {
  try {
    const stored: unknown = JSON.parse(localStorage.getItem(key) ?? '{}');
    if (typeof stored !== 'object' || stored === null) return defaults;
    const known = Object.entries(stored).filter(([name, value]) =>
      name in defaults && typeof value === typeof defaults[name as keyof Settings]);
    return { ...defaults, ...Object.fromEntries(known) };
  } catch {
    return defaults;
  }
}

/** Remembers a change and returns all settings. */
export function changeSettings(change: Partial<Settings>): Settings {
  const all = { ...readSettings(), ...change };
  try {
    localStorage.setItem(key, JSON.stringify(all));
  } catch {
    // A browser without storage forgets them.
  }
  return all;
}
