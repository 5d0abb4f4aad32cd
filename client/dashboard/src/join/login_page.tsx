// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { errorText, getStatus, login } from '../api/server_api';
import { useFeedControl } from '../shell/feed_context';
import { Panel, Problem } from '../shell/parts';
import { hashOf, type Route } from '../shell/route';

/** Exchanges a token for a cookie: one from the link, or one that is pasted. */
export function LoginPage({ route }: { route: Route }): JSX.Element {
  const feed = useFeedControl();
  const [token, setToken] = useState('');
  const [problem, setProblem] = useState('');
  const tried = useRef(false);
  const enterPage = (): void => {
    if (location.pathname === '/login') location.replace(`/${hashOf('wave')}`);
    else location.replace(hashOf('wave'));
    feed.retryNow();
  };
  const enter = async (value: string): Promise<void> => {
    setProblem('');
    try {
      // A whole link may be pasted, too.
      await login(/(?:token=|\b)(rk1\.[\w-]+)/.exec(value)?.[1] ?? value.trim());
      enterPage();
    } catch (error) {
      // On the server's own PC nobody needs to log in.
      if (await getStatus().then(() => true, () => false)) enterPage();
      else setProblem(errorText(error));
    }
  };
  const linked = route.parameters.get('token') ?? '';
  useEffect(() => {
    if (linked === '' || tried.current) return;
    tried.current = true;
    // The secret does not stay in the address or in the history.
    history.replaceState(null, '', location.pathname === '/login' ? '/login' : hashOf('login'));
    void enter(linked);
  }, [linked]);
  return <div class="login"><Panel name="token" title="This server wants to know who you are">
    <form onSubmit={(event) => {
      event.preventDefault();
      void enter(token);
    }}>
      <label>Join string or link<input type="password" autocomplete="off" value={token} onInput={(event) => setToken(event.currentTarget.value)} /></label>
      <button type="submit" class="primary" disabled={token.trim() === ''}>Log in</button>
    </form>
    <Problem text={problem} />
    <p class="hint">Whoever runs the server makes one: <code>rigcal token create --role operator</code></p>
  </Panel></div>;
}
