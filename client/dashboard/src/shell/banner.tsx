// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { dateTime, span } from '../view/format';
import { useFeed, useFeedControl } from './feed_context';

/** Says that data are old, and how old; and that the server was restarted. */
export function Banner(): JSX.Element {
  const feed = useFeedControl();
  const state = useFeed();
  // Those that take over when this one is gone.
  const others = (state.status?.servers ?? []).map((server) => server.page ?? '')
    .filter((page) => page !== '' && !page.startsWith(`${location.origin}/`));
  const first = state.answeredAt === undefined;
  const text = !state.stale ? ''
    : first ? state.problem || 'Waiting for the server.'
      : state.problem || 'The server does not answer.';
  return <div class="banners">
    {/* What is spoken does not change with every second. */}
    <p class="hidden" role="status">{text}</p>
    {text !== '' && <div class="banner warn"><span aria-hidden="true">⚠</span>
      <p>{text} {!first && <b>Data are {span(feed.ageMs() / 1000)} old.</b>} It is tried again by itself.{others.length > 0 && ' Another server may have taken over:'}
        {others.map((page) => <span key={page}> <a href={`${page}${location.hash}`}>{page}</a></span>)}</p>
      <button type="button" onClick={feed.retryNow}>Try now</button></div>}
    {state.restartedAt !== undefined && <div class="banner info" role="status"><span aria-hidden="true">i</span>
      <p>The server was restarted ({dateTime(state.restartedAt)}). What is shown is from the new one.</p>
      <button type="button" onClick={() => feed.dismissRestart()}>Read</button></div>}
  </div>;
}
