// SPDX-License-Identifier: Apache-2.0
import { Component, type ComponentChild, type FunctionComponent, h } from 'preact';

/** A part that is drawn anew only when one of its properties is another object or value. */
export function memo<P extends object>(part: FunctionComponent<P>): FunctionComponent<P> {
  class Memo extends Component<P> {
    override shouldComponentUpdate(next: Readonly<P>): boolean {
      const now = this.props as Record<string, unknown>;
      return Object.entries(next).some(([name, value]) => now[name] !== value);
    }

    override render(): ComponentChild {
      return h(part, this.props as P);
    }
  }
  return Memo as unknown as FunctionComponent<P>;
}
