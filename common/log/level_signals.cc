// SPDX-License-Identifier: Apache-2.0
#include "common/log/level_signals.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "common/log/start_log.h"

namespace rigcal {
namespace {

// Every level but "critical", which has no name in configurations.
constexpr spdlog::level::level_enum kLevels[] = {spdlog::level::trace, spdlog::level::debug,
                                                 spdlog::level::info,  spdlog::level::warn,
                                                 spdlog::level::err,   spdlog::level::off};

// `steps` further in the list, or its end.
spdlog::level::level_enum LevelBeside(spdlog::level::level_enum level, int steps) {
  const auto* const at = std::find(std::begin(kLevels), std::end(kLevels), level);
  const auto index =
      std::clamp<std::ptrdiff_t>(at - std::begin(kLevels) + steps, 0, std::ssize(kLevels) - 1);
  return kLevels[index];
}

// Seen at whichever of the two levels logs more.
void Change(spdlog::level::level_enum level, int signal) {
  const std::string before = LogLevel();
  const auto more = std::min(spdlog::get_level(), level);
  spdlog::set_level(level);
  const std::string after = LogLevel();
  spdlog::set_level(more);
  if (more != spdlog::level::off) {
    spdlog::log(std::max(more, spdlog::level::info), "signal {}: the log level is {}, it was {}",
                signal, after, before);
  }
  spdlog::set_level(level);
}

}  // namespace

void AddLevelSignals(bool has_config, sigset_t* signals) {
  sigaddset(signals, SIGUSR1);
  sigaddset(signals, SIGUSR2);
  if (has_config) sigaddset(signals, SIGHUP);
}

bool TakeLevelSignal(int signal, const std::function<absl::StatusOr<std::string>()>& read_level) {
  if (signal == SIGUSR1) {
    Change(LevelBeside(spdlog::get_level(), -1), signal);
  } else if (signal == SIGUSR2) {
    Change(LevelBeside(spdlog::get_level(), 1), signal);
  } else if (signal == SIGHUP) {
    const absl::StatusOr<std::string> level = read_level();
    if (level.ok()) {
      Change(spdlog::level::from_str(*level), signal);
    } else {
      spdlog::error("the log level stays as it is: {}", std::string(level.status().message()));
    }
  } else {
    return false;
  }
  return true;
}

}  // namespace rigcal
