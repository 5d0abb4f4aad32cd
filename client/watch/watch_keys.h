// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>

namespace rigcal::client {

// What the keys of `rigcal watch` mean. One key alone stops no session: `s` asks, `y` confirms, and
// every other key takes the question back.
class WatchKeys {
 public:
  enum class Act {
    kNone,
    kLeave,
    kAsk,   // whether the session is to be stopped
    kStop,  // stop the session that was asked about
    kKeep,  // the answer was no
  };

  // `session`: the live one; empty: there is none. `key` 0: none was pressed.
  Act Press(char key, const std::string& session) {
    if (key == 0) return Act::kNone;
    const std::string asked = std::exchange(asked_, "");
    if (key == 'q' || key == 'Q') return Act::kLeave;
    // Another session may have begun meanwhile.
    if (!asked.empty() && asked == session && (key == 'y' || key == 'Y')) return Act::kStop;
    if (asked.empty() && (key == 's' || key == 'S')) {
      asked_ = session;
      return Act::kAsk;
    }
    return asked.empty() ? Act::kNone : Act::kKeep;
  }

 private:
  std::string asked_;  // the session that a question is open about
};

}  // namespace rigcal::client
