// SPDX-License-Identifier: Apache-2.0
import type { Calibration } from '../api/types';
import type { Mark } from '../shell/parts';

const grades: Record<string, readonly [Mark, string]> = {
  GRADE_GOOD: ['good', 'good: use it'], GRADE_USABLE: ['warn', 'usable, aware of the reasons'],
  GRADE_BAD: ['bad', 'bad: do not use it'],
};

/** Symbol and words of a grade, or of the state of a calibration that has none. */
export function gradeOf(calibration: Calibration): readonly [Mark, string] {
  if (calibration.state === 'STATE_SUCCEEDED') return grades[calibration.quality?.grade ?? ''] ?? ['good', 'not graded'];
  if (calibration.state === 'STATE_FAILED') return ['bad', 'failed'];
  if (calibration.state === 'STATE_CANCELLED') return ['idle', 'cancelled'];
  return calibration.state === 'STATE_RUNNING' ? ['live', 'running'] : ['idle', 'queued'];
}

/** The same in one word, for lists. */
export function calibrationMark(calibration: Calibration): readonly [Mark, string] {
  const [mark, words] = gradeOf(calibration);
  return [mark, words.split(/[:,]/)[0]!];
}

/** Nobody works on it any more. */
export function hasEnded(state: string | undefined): boolean {
  return state === 'STATE_SUCCEEDED' || state === 'STATE_FAILED' || state === 'STATE_CANCELLED';
}
