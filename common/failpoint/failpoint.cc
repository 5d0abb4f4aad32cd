// SPDX-License-Identifier: Apache-2.0
#include "common/failpoint/failpoint.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <thread>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"

namespace rigcal {
namespace {

constexpr char kVariable[] = "RIGCAL_FAILPOINT";
constexpr int kMaxSleepMs = 600'000;

struct ActiveFailpoint {
  explicit ActiveFailpoint(FailpointAction configured) : action(std::move(configured)) {}
  const FailpointAction action;
  std::atomic<uint64_t> passes{0};
};

// Filled before threads begin, and then only read.
std::deque<ActiveFailpoint>& ActiveFailpoints() {
  static auto* const kList = new std::deque<ActiveFailpoint>;
  return *kList;
}

absl::StatusOr<FailpointAction> ParseOne(absl::string_view part) {
  const auto fault = [&](absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat(kVariable, ": '", part, "': ", what));
  };
  const std::vector<absl::string_view> halves = absl::StrSplit(part, absl::MaxSplits(':', 1));
  if (halves.size() != 2) return fault("must be NAME:abort or NAME:sleep_MS, with @N if wanted");
  FailpointAction action;
  action.name = std::string(halves[0]);
  if (std::ranges::find(kFailpointNames, action.name) == std::end(kFailpointNames)) {
    return fault(absl::StrCat("no such failpoint; there are ",
                              absl::StrJoin(kFailpointNames, ", ", [](std::string* out, auto name) {
                                out->append(name);
                              })));
  }
  std::pair<absl::string_view, absl::string_view> what =
      absl::StrSplit(halves[1], absl::MaxSplits('@', 1));
  if (halves[1].find('@') != absl::string_view::npos &&
      (!absl::SimpleAtoi(what.second, &action.pass) || action.pass == 0)) {
    return fault("the pass behind @ must be a number from 1 on");
  }
  if (what.first == "abort") {
    action.abort = true;
    return action;
  }
  int sleep_ms = 0;
  if (!absl::ConsumePrefix(&what.first, "sleep_") || !absl::SimpleAtoi(what.first, &sleep_ms) ||
      sleep_ms < 1 || sleep_ms > kMaxSleepMs) {
    return fault(absl::StrCat("the action must be abort or sleep_MS with 1 to ", kMaxSleepMs));
  }
  action.sleep = std::chrono::milliseconds(sleep_ms);
  return action;
}

}  // namespace

namespace failpoint_internal {

std::atomic<bool> active{false};

void Pass(std::string_view name) {
  for (ActiveFailpoint& point : ActiveFailpoints()) {
    if (point.action.name != name) continue;
    const uint64_t pass = ++point.passes;
    if (pass < point.action.pass) continue;
    if (!point.action.abort) {
      std::this_thread::sleep_for(point.action.sleep);
    } else if (pass == point.action.pass) {
      std::fprintf(stderr, "failpoint %s: abort\n", point.action.name.c_str());
      std::abort();
    }
  }
}

}  // namespace failpoint_internal

absl::StatusOr<std::vector<FailpointAction>> ParseFailpoints(std::string_view text) {
  std::vector<FailpointAction> actions;
  const absl::string_view all(text.data(), text.size());
  for (const absl::string_view part : absl::StrSplit(all, ',', absl::SkipEmpty())) {
    absl::StatusOr<FailpointAction> action = ParseOne(part);
    if (!action.ok()) return action.status();
    actions.push_back(*std::move(action));
  }
  return actions;
}

absl::Status ActivateFailpoints() {
  const char* const text = std::getenv(kVariable);
  if (text == nullptr || *text == '\0') return absl::OkStatus();
  absl::StatusOr<std::vector<FailpointAction>> actions = ParseFailpoints(text);
  if (!actions.ok()) return actions.status();
  for (FailpointAction& action : *actions) ActiveFailpoints().emplace_back(std::move(action));
  failpoint_internal::active = true;
  return absl::OkStatus();
}

}  // namespace rigcal
