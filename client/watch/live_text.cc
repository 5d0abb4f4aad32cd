// SPDX-License-Identifier: Apache-2.0
#include "client/watch/live_text.h"

#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/output/console.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/tables/notable_cameras.h"

namespace rigcal::client {
namespace {

using google::protobuf::util::TimeUtil;

// Data that are older than this are said to be.
constexpr double kOldS = 2;
constexpr size_t kBarCells = 10;
// Of a large rig so many alerts have a line each, so that some cameras stay on the screen.
constexpr int kMostAlerts = 6;
constexpr char kRed[] = "\x1b[1;31m";
constexpr char kYellow[] = "\x1b[33m";
constexpr char kBold[] = "\x1b[1m";
constexpr char kPlain[] = "\x1b[0m";

double ElapsedS(const v1::LiveState& live) {
  const v1::Session& session = live.session();
  if (!session.has_start_time()) return 0;
  const auto end = session.has_stop_time() ? session.stop_time() : live.time();
  const int64_t ns = TimeUtil::TimestampToNanoseconds(end) -
                     TimeUtil::TimestampToNanoseconds(session.start_time());
  return 1e-9 * static_cast<double>(std::max<int64_t>(ns, 0));
}

std::string SessionText(const v1::LiveState& live) {
  if (!live.has_session()) return "no session";
  const v1::Session& session = live.session();
  std::string text = absl::StrCat("session ", session.id(), " ", EnumWord(session.state()));
  if (session.has_start_time()) {
    absl::StrAppend(&text, ", ", FormatFixed(ElapsedS(live), 0), " s");
  }
  if (!session.stop_reason().empty()) absl::StrAppend(&text, ": ", session.stop_reason());
  return text;
}

bool HasFigure(const v1::LiveState& live) {
  return live.estimate().has_volume() && live.estimate().volume().p95_mm() > 0;
}

std::string FigureText(const v1::LiveState& live) {
  if (!HasFigure(live)) return "- mm";
  const v1::LiveVolume& volume = live.estimate().volume();
  return absl::StrCat(FormatPointError(1e-3 * volume.p95_mm(), volume.scale_sigma_rel()),
                      live.estimate().scale_known() ? "" : " (scale not known)");
}

bool HasFinished(const v1::LiveState& live) {
  return live.has_session() && live.session().state() == v1::Session::STATE_FINISHED;
}

// Why there is no figure, or how it stands with the goal.
std::string GoalText(const v1::LiveState& live) {
  std::string text;
  if (HasFinished(live)) {
    return absl::StrCat(HasFigure(live)
                            ? "the last estimate of a session that has finished"
                            : "the session has finished, and nothing is estimated any more",
                        ": rigcal calibration list --session ", live.session().id(),
                        " has its results, rigcal calibrate ", live.session().id(), " makes one");
  }
  if (live.has_goal()) {
    const v1::LiveGoal& goal = live.goal();
    text = absl::StrFormat("goal %.3g mm: %s", goal.until_mm(),
                           goal.reached() ? "reached" : "goes on, " + goal.why_not());
  } else if (live.estimate().state() == v1::LiveEstimate::STATE_FAILED) {
    text = absl::StrCat("the estimate fails: ", live.estimate().problem());
  } else if (!HasFigure(live) && !live.estimate().needs().empty()) {
    const v1::LivePairNeed& need = live.estimate().needs(0);
    text = absl::StrCat(need.camera_a(), " and ", need.camera_b(),
                        " need more together: ", need.common_count(), " of ",
                        FormatCount(need.needed_count(), "instant"));
  }
  return text;
}

// Of those that capture, the one with the fewest shared instants, then with the least coverage.
const v1::LiveCamera* WorstCamera(const v1::LiveState& live) {
  const v1::LiveCamera* worst = nullptr;
  const auto key = [](const v1::LiveCamera& camera) {
    return std::pair(std::min(camera.shared_instant_count(), camera.shared_instant_goal()),
                     camera.coverage().covered_share());
  };
  for (const v1::LiveCamera& camera : live.cameras()) {
    if (camera.shared_instant_goal() == 0) continue;  // it has no part in the session
    if (worst == nullptr || key(camera) < key(*worst)) worst = &camera;
  }
  return worst;
}

std::string Percent(double share) { return absl::StrCat(FormatFixed(100 * share, 0), "%"); }

std::string WorstText(const v1::LiveState& live) {
  const v1::LiveCamera* const worst = WorstCamera(live);
  if (worst == nullptr) return "";
  return absl::StrCat(worst->camera(), " (", worst->shared_instant_count(), " shared, ",
                      Percent(worst->coverage().covered_share()), " covered)");
}

std::string Bar(double share) {
  const auto cells = static_cast<size_t>(
      std::lround(std::clamp(share, 0.0, 1.0) * static_cast<double>(kBarCells)));
  return absl::StrCat("[", std::string(cells, '#'), std::string(kBarCells - cells, '.'), "]");
}

std::string ClockText(const v1::LiveClock& clock) {
  // Set by the wand's light code; what the estimate found on top of that says little.
  if (clock.wand() != 0) return absl::StrFormat("by wand %d", static_cast<int>(clock.wand()));
  if (clock.has_time_offset_s()) {
    return absl::StrFormat("%+.1f ms", 1e3 * clock.time_offset_s());
  }
  if (clock.has_sample_spread_s()) {
    return absl::StrFormat("spread %.1f ms", 1e3 * clock.sample_spread_s());
  }
  return "-";
}

std::string AlertKindOf(const v1::LiveState& live, const std::string& camera) {
  for (const v1::LiveAlert& alert : live.alerts().alerts()) {
    if (alert.camera() == camera) return alert.kind();
  }
  return "";
}

// Those that a person must do something about.
std::vector<std::string> LiveCamerasInNeed(const v1::LiveState& live) {
  std::set<std::string> named;
  for (const v1::LiveAlert& alert : live.alerts().alerts()) {
    if (alert.severity() >= v1::LiveAlert::SEVERITY_WARNING) named.insert(alert.camera());
  }
  std::vector<std::string> names;
  for (const v1::LiveCamera& camera : live.cameras()) {
    if (named.contains(camera.camera()) || camera.dropped_count() > 0 ||
        camera.state() == v1::LiveCamera::STATE_OFFLINE) {
      names.push_back(camera.camera());
    }
  }
  return names;
}

bool IsLarge(const v1::LiveState& live) {
  return static_cast<size_t>(live.cameras_size()) > kFewCameras;
}

// As they are shown: of a large rig those that need something first, then those that have seen
// least together with others.
std::vector<const v1::LiveCamera*> CamerasInOrder(const v1::LiveState& live, bool all) {
  std::vector<const v1::LiveCamera*> cameras;
  for (const v1::LiveCamera& camera : live.cameras()) cameras.push_back(&camera);
  if (all || !IsLarge(live)) return cameras;
  const std::vector<std::string> needing = LiveCamerasInNeed(live);
  const std::set<std::string> first(needing.begin(), needing.end());
  std::ranges::stable_sort(cameras, {}, [&](const v1::LiveCamera* camera) {
    const uint32_t goal = camera->shared_instant_goal();
    const double share = goal == 0 ? 1 : std::min(1.0, 1.0 * camera->shared_instant_count() / goal);
    return std::pair(!first.contains(camera->camera()), share);
  });
  return cameras;
}

// How many cameras are where the active calibration has them; "" without a monitor.
std::string MonitorText(const v1::LiveMonitor& monitor) {
  if (monitor.mode() != v1::MONITOR_MODE_WATCH && monitor.mode() != v1::MONITOR_MODE_REPAIR) {
    return "";
  }
  if (monitor.calibration_id().empty()) return "no active calibration";
  size_t good = 0;
  std::vector<std::string> moved, unknown;
  for (const v1::LiveMonitoredCamera& camera : monitor.cameras()) {
    good += camera.verdict() == v1::LiveMonitoredCamera::VERDICT_GOOD;
    if (camera.verdict() == v1::LiveMonitoredCamera::VERDICT_MOVED)
      moved.push_back(camera.camera());
    if (camera.verdict() == v1::LiveMonitoredCamera::VERDICT_UNKNOWN) {
      unknown.push_back(camera.camera());
    }
  }
  std::string text = absl::StrCat(
      good, " of ", FormatCount(static_cast<uint64_t>(monitor.cameras_size()), "camera"), " where ",
      monitor.calibration_id(), " has them");
  if (!moved.empty()) absl::StrAppend(&text, ", moved: ", absl::StrJoin(moved, ", "));
  if (!unknown.empty() && unknown.size() < static_cast<size_t>(monitor.cameras_size())) {
    absl::StrAppend(&text, ", cannot tell: ", absl::StrJoin(unknown, ", "));
  }
  return text;
}

// At most so many columns, taking each code point for one.
std::string Clip(std::string_view text, size_t columns) {
  if (DisplayWidth(text) <= columns) return std::string(text);
  size_t width = 0;
  size_t end = 0;
  while (end < text.size()) {
    const bool begins = (static_cast<unsigned char>(text[end]) & 0xC0U) != 0x80U;
    if (begins && width + 1 > columns) break;
    width += begins ? 1 : 0;
    ++end;
  }
  return std::string(text.substr(0, end));
}

class Screen {
 public:
  explicit Screen(const LiveScreenOptions& options) : options_(options) {}

  // `style`: an escape sequence, used with colour only.
  void Add(std::string_view text, const char* style = nullptr) {
    if (lines_.size() >= options_.rows) return;
    std::string line = Clip(Printable(text), options_.columns);
    if (options_.colour && style != nullptr) line = absl::StrCat(style, line, kPlain);
    lines_.push_back(std::move(line));
  }
  std::vector<std::string> Take() { return std::move(lines_); }

 private:
  const LiveScreenOptions& options_;
  std::vector<std::string> lines_;
};

void AddTable(const v1::LiveState& live, bool all, Screen* screen) {
  TextTable table;
  table.Words({"camera", "state"})
      .Numbers({"rows/s", "wand/s"})
      .Words({"coverage"})
      .Numbers({"shared", "error px", "waiting", "lost"})
      .Words({"clock", "alert"});
  for (const v1::LiveCamera* const one : CamerasInOrder(live, all)) {
    const v1::LiveCamera& camera = *one;
    table.AddRow(
        {camera.camera(), EnumWord(camera.state()), FormatFixed(camera.observation_rate_hz(), 0),
         FormatFixed(camera.wand_rate_hz(), 0),
         absl::StrCat(Bar(camera.coverage().covered_share()), " ",
                      Percent(camera.coverage().covered_share())),
         absl::StrCat(camera.shared_instant_count(), "/", camera.shared_instant_goal()),
         camera.reprojection_rms_px() > 0 ? FormatFixed(camera.reprojection_rms_px(), 2) : "-",
         camera.backlog_count(), camera.dropped_count(), ClockText(camera.clock()),
         AlertKindOf(live, camera.camera())});
  }
  const std::string text = table.Format();
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    screen->Add(std::string_view(text).substr(begin, end - begin), begin == 0 ? kBold : nullptr);
    begin = end + 1;
  }
}

}  // namespace

std::vector<std::string> FormatLiveScreen(const v1::LiveState& live,
                                          const LiveScreenOptions& options) {
  Screen screen(options);
  screen.Add(absl::StrCat("rig ", live.rig(), "   ", SessionText(live), "   ", options.server));
  if (!options.problem.empty()) {
    screen.Add(
        absl::StrCat("OLD DATA: the server has not answered for ", FormatFixed(options.age_s, 0),
                     " s (", options.problem, "); trying again"),
        kRed);
  } else if (options.age_s > kOldS) {
    screen.Add(absl::StrCat("OLD DATA: ", FormatFixed(options.age_s, 0), " s old"), kRed);
  }
  screen.Add("");
  screen.Add(absl::StrCat("    expected error  ", FigureText(live)), kBold);
  if (const std::string goal = GoalText(live); !goal.empty()) {
    screen.Add(absl::StrCat("    ", goal));
  }
  for (const v1::LiveAdvice& advice : live.estimate().advice()) {
    screen.Add(absl::StrCat("    wave next: ", advice.text()));
  }
  if (const std::string monitor = MonitorText(live.monitor()); !monitor.empty()) {
    screen.Add(absl::StrCat("    monitor: ", monitor));
  }
  screen.Add("");
  // Alerts come before the table: with many cameras the end is cut off.
  int alerts = 0;
  for (const v1::LiveAlert& alert : live.alerts().alerts()) {
    if (IsLarge(live) && !options.all && ++alerts > kMostAlerts) {
      screen.Add(absl::StrCat("and ", live.alerts().alerts_size() - kMostAlerts, " more alerts"));
      break;
    }
    const bool error = alert.severity() == v1::LiveAlert::SEVERITY_ERROR;
    const bool warning = alert.severity() == v1::LiveAlert::SEVERITY_WARNING;
    screen.Add(absl::StrCat(error     ? "ERROR "
                            : warning ? "WARNING "
                                      : "note ",
                            alert.text()),
               error     ? kRed
               : warning ? kYellow
                         : nullptr);
  }
  if (const std::string worst = WorstText(live); !worst.empty()) {
    screen.Add(absl::StrCat("worst camera: ", worst));
  }
  if (IsLarge(live)) {
    screen.Add(NeedsSummary(static_cast<size_t>(live.cameras_size()), LiveCamerasInNeed(live)));
  }
  AddTable(live, options.all, &screen);
  screen.Add("");
  const char* const keys = HasFinished(live) ? "q: leave" : "s: stop the session   q: leave";
  screen.Add(options.message.empty() ? keys : options.message);
  return screen.Take();
}

namespace {

// What the cameras do for the session, and where to wave next.
void AppendProgress(const v1::LiveState& live, std::string* line) {
  size_t capturing = 0;
  double rate_hz = 0;
  double wand_hz = 0;
  for (const v1::LiveCamera& camera : live.cameras()) {
    capturing += camera.state() == v1::LiveCamera::STATE_CAPTURING;
    rate_hz += camera.observation_rate_hz();
    wand_hz += camera.wand_rate_hz();
  }
  absl::StrAppend(line, "; ", capturing, " of ",
                  FormatCount(static_cast<uint64_t>(live.cameras_size()), "camera"), ", ",
                  FormatFixed(rate_hz, 0), " rows/s, ", FormatFixed(wand_hz, 0), " with wand");
  if (const std::string worst = WorstText(live); !worst.empty()) {
    absl::StrAppend(line, "; worst ", worst);
  }
  if (!live.estimate().advice().empty()) {
    absl::StrAppend(line, "; wave next: ", live.estimate().advice(0).text());
  }
}

}  // namespace

std::string FormatLiveLine(const v1::LiveState& live) {
  std::string line = absl::StrCat(SessionText(live), "; ", FigureText(live));
  if (const std::string goal = GoalText(live); !goal.empty())
    absl::StrAppend(&line, " (", goal, ")");
  if (!HasFinished(live)) AppendProgress(live, &line);
  if (const std::string monitor = MonitorText(live.monitor()); !monitor.empty()) {
    absl::StrAppend(&line, "; monitor: ", monitor);
  }
  if (IsLarge(live)) {
    absl::StrAppend(
        &line, "; ",
        NeedsSummary(static_cast<size_t>(live.cameras_size()), LiveCamerasInNeed(live)));
  }
  for (const v1::LiveAlert& alert : live.alerts().alerts()) {
    if (IsLarge(live) && !alert.camera().empty()) continue;
    absl::StrAppend(&line, "; ", EnumWord(alert.severity()), " ", alert.kind(),
                    alert.camera().empty() ? "" : " ", alert.camera());
  }
  return Printable(line);
}

}  // namespace rigcal::client
