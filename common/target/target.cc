// SPDX-License-Identifier: Apache-2.0
#include "common/target/target.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/board/board.h"
#include "common/options/option_table.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"
#include "common/target/target_file.h"
#include "common/text/shortest_text.h"

namespace rigcal {

void AddOptions(Target* target, OptionTable* table);

namespace {

constexpr char kExample[] = "wand:0,0.13,0.39;diameter=0.04;hz=500;tolerance=0.002";
constexpr char kHowWritten[] =
    "positions are in metres, without a unit, with a comma between them and a point before "
    "decimals";
constexpr double kMaxLengthM = 20;     // more is millimetres typed as metres
constexpr double kMaxWavedM = 4;       // more was typed for a wand in another unit, in which it is
constexpr double kLeastWavedM = 0.05;  // at least this long
constexpr double kMinSpanM = 1e-4;     // closer markers are one marker
constexpr double kMaxDiameterM = 1;
constexpr double kMaxBlinkHz = 1e6;
constexpr double kMaxToleranceM = 1;
constexpr size_t kMaxTextLength = 32768;
constexpr size_t kMaxLabelLength = 32;
constexpr double kMaxPointSigmaM = 0.1;
constexpr int kMinLabelledPoints = 4;  // with positions
// Of the farthest point from the first: the others must be this far from the line through both.
constexpr double kMinWidthShare = 0.02;

absl::Status Refuse(std::string_view text, std::string_view why) {
  return absl::InvalidArgumentError(
      absl::StrCat("target \"", absl::CHexEscape(std::string(text.substr(0, 200))),
                   "\": ", std::string(why), "; example: ", kExample));
}

absl::Status ParseNumbers(std::string_view part, std::vector<double>* numbers) {
  for (absl::string_view item : absl::StrSplit(absl::string_view(part.data(), part.size()), ',')) {
    const std::string word(absl::StripAsciiWhitespace(item));
    double value = 0;
    if (!absl::SimpleAtod(word, &value) || !std::isfinite(value)) {
      return absl::InvalidArgumentError(
          absl::StrCat("\"", absl::CHexEscape(word.substr(0, 64)), "\" in \"",
                       absl::CHexEscape(std::string(part.substr(0, 100))),
                       "\" is not a finite number; ", kHowWritten));
    }
    numbers->push_back(value);
  }
  return absl::OkStatus();
}

// Positions as they were typed, for a wand that is meant to be another one.
std::string WandText(const std::vector<double>& positions) {
  const auto append = [](std::string* out, double value) {
    out->append(ShortestText(std::round(value * 1e6) / 1e6));
  };
  return absl::StrCat("wand:", absl::StrJoin(positions, ",", append));
}

// Columns of rows and frequencies belong to markers by their order, which only the user can change.
absl::Status CheckOrder(const std::vector<double>& positions) {
  if (std::ranges::is_sorted(positions)) return absl::OkStatus();
  std::vector<double> sorted = positions;
  std::ranges::sort(sorted);
  const double first = sorted.front();
  for (double& position : sorted) position -= first;
  std::string message = absl::StrCat("positions must increase from marker to marker: did you mean ",
                                     WandText(sorted));
  if (std::is_sorted(positions.rbegin(), positions.rend())) {
    std::vector<double> other_way;
    for (const double position : positions) other_way.push_back(positions.front() - position);
    absl::StrAppend(&message,
                    ", or, measured from the other end with the markers in the order given, ",
                    WandText(other_way));
  }
  return absl::InvalidArgumentError(message + "?");
}

absl::Status CheckDistinct(std::vector<double> positions) {
  std::ranges::sort(positions);
  for (size_t i = 1; i < positions.size(); ++i) {
    if (positions[i] - positions[i - 1] >= kMinSpanM) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "markers at ", positions[i - 1], " and ", positions[i],
        " are at the same position, a wand needs at least two distinct positions and each only "
        "once; ",
        kHowWritten));
  }
  return absl::OkStatus();
}

// Who leaves out the first marker's 0 means another wand than who measures from somewhere else.
absl::Status CheckFirst(const std::vector<double>& positions) {
  if (positions.empty() || positions.front() <= 0) return absl::OkStatus();
  std::vector<double> with_zero = {0}, from_first;
  for (const double position : positions) {
    with_zero.push_back(position);
    from_first.push_back(position - positions.front());
  }
  return absl::InvalidArgumentError(
      absl::StrCat("positions begin with the first marker's 0: did you mean ", WandText(with_zero),
                   " (", with_zero.size(), " markers) or ", WandText(from_first), " (",
                   from_first.size(), " markers)?"));
}

// Moves the positions to begin at 0.
absl::Status Normalise(Target* target) {
  std::vector<double>& positions = target->marker_positions_m;
  RIGCAL_RETURN_IF_ERROR(CheckDistinct(positions));
  RIGCAL_RETURN_IF_ERROR(CheckOrder(positions));
  if (target->kind == TargetKind::kWand) RIGCAL_RETURN_IF_ERROR(CheckFirst(positions));
  const double first = positions.empty() ? 0 : positions.front();
  for (double& position : positions) position -= first;
  if (!positions.empty() && positions.back() > kMaxWavedM) {
    std::vector<std::string> guesses;
    for (const auto& [unit, per_metre] :
         {std::pair("millimetres", 1000.0), std::pair("centimetres", 100.0)}) {
      const double length_m = positions.back() / per_metre;
      if (length_m < kLeastWavedM || length_m > kMaxWavedM) continue;
      std::vector<double> meant;
      for (const double position : positions) meant.push_back(position / per_metre);
      guesses.push_back(absl::StrCat("; if these are ", unit, ", write ", WandText(meant)));
    }
    return absl::InvalidArgumentError(absl::StrCat(
        "the wand is ", positions.back(), " m long, and nobody waves one of more than ", kMaxWavedM,
        " m: positions are in metres", absl::StrJoin(guesses, "")));
  }
  return absl::OkStatus();
}

// From a file, or what would be in it in braces, the lines separated by |.
absl::StatusOr<std::vector<GivenPoint>> ParsePoints(std::string_view text, PointLines lines) {
  if (!text.starts_with('{') || !text.ends_with('}')) {
    return ReadTargetFile(std::string(text), lines);
  }
  std::vector<GivenPoint> points;
  for (const auto line : absl::StrSplit(absl::string_view(text.data() + 1, text.size() - 2), '|',
                                        absl::SkipWhitespace())) {
    RIGCAL_ASSIGN_OR_RETURN(GivenPoint point, ParseTargetPoint({line.data(), line.size()}, lines));
    points.push_back(std::move(point));
  }
  return points;
}

absl::Status ParseLabelledPoints(std::string_view text, Target* target) {
  const PointLines lines =
      target->IsStatic() ? PointLines::kMayBeLabels : PointLines::kWithPosition;
  RIGCAL_ASSIGN_OR_RETURN(std::vector<GivenPoint> given, ParsePoints(text, lines));
  const auto surveyed =
      static_cast<size_t>(std::ranges::count(given, true, &GivenPoint::has_position));
  if (surveyed != 0 && surveyed != given.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat(surveyed, " of ", given.size(),
                     " static points have a position: give all positions, or only labels"));
  }
  target->is_surveyed = target->IsStatic() && surveyed > 0;
  for (GivenPoint& point : given) target->points.push_back(std::move(point.point));
  return absl::OkStatus();
}

// Takes `flatness=` from the options.
absl::StatusOr<Target> ParseBoardTarget(const std::string& text, std::vector<std::string>* parts) {
  constexpr std::string_view kFlatness = "flatness=";
  RIGCAL_ASSIGN_OR_RETURN(const Board board, ParseBoard(text));
  double sigma_m = kBoardSigmaM;
  const auto given = std::ranges::find_if(
      *parts, [&](const std::string& part) { return part.starts_with(kFlatness); });
  if (given != parts->end()) {
    const std::string value = given->substr(kFlatness.size());
    if (!absl::SimpleAtod(value, &sigma_m)) {
      return absl::InvalidArgumentError(absl::StrCat(
          "flatness \"", absl::CHexEscape(value.substr(0, 64)), "\" is no number of metres"));
    }
    parts->erase(given);
  }
  if (!(sigma_m >= 0 && sigma_m <= kMaxPointSigmaM)) {
    return absl::InvalidArgumentError(
        absl::StrCat("the flatness is ", sigma_m, " m, it must be 0 to ", kMaxPointSigmaM));
  }
  if (parts->size() > 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", absl::CHexEscape((*parts)[1].substr(0, 64)),
                     "\" is no option of a board, which has flatness= alone"));
  }
  return MakeBoardTarget(board, sigma_m);
}

absl::Status ParseParts(std::string_view text, Target* target) {
  std::vector<std::string> parts;
  for (absl::string_view part : absl::StrSplit(absl::string_view(text.data(), text.size()), ';')) {
    parts.emplace_back(absl::StripAsciiWhitespace(part));
  }
  constexpr std::string_view kWandPrefix = "wand:", kRigidPrefix = "rigid:",
                             kStaticPrefix = "static:";
  const std::string head = parts[0];
  if (head.starts_with("board:")) {
    RIGCAL_ASSIGN_OR_RETURN(*target, ParseBoardTarget(head, &parts));
  } else if (head == "point") {
    target->kind = TargetKind::kPoint;
    target->marker_positions_m = {0};
  } else if (head.starts_with(kWandPrefix)) {
    RIGCAL_RETURN_IF_ERROR(
        ParseNumbers(head.substr(kWandPrefix.size()), &target->marker_positions_m));
  } else if (head.starts_with(kRigidPrefix)) {
    target->kind = TargetKind::kRigid;
    RIGCAL_RETURN_IF_ERROR(ParseLabelledPoints(head.substr(kRigidPrefix.size()), target));
  } else if (head.starts_with(kStaticPrefix)) {
    target->kind = TargetKind::kStatic;
    RIGCAL_RETURN_IF_ERROR(ParseLabelledPoints(head.substr(kStaticPrefix.size()), target));
  } else {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", absl::CHexEscape(head.substr(0, 64)),
                     "\" is not a target: it must be \"wand:\" and positions in metres, "
                     "\"rigid:\" or \"static:\" and a file of points, \"board:\" and a printed "
                     "board, or \"point\""));
  }
  parts.erase(parts.begin());
  // "wand:0;0,13;0,39", as it is written where decimals have a comma.
  for (const std::string& part : parts) {
    if (part.empty() || !absl::ascii_isdigit(static_cast<unsigned char>(part[0]))) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("\"", absl::CHexEscape(part.substr(0, 64)), "\" is no option; ", kHowWritten));
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<OptionText> given, SplitOptions(parts));
  OptionTable table;
  AddOptions(target, &table);
  FaultList faults;
  table.Read(given, &faults);
  RIGCAL_RETURN_IF_ERROR(faults.Result());
  if (!target->IsLine()) return target->Validate();
  if (target->marker_count() > kMaxWandMarkers) {
    return absl::InvalidArgumentError(
        absl::StrCat(target->marker_count(), " markers, at most ", kMaxWandMarkers));
  }
  RIGCAL_RETURN_IF_ERROR(Normalise(target));
  return target->Validate();
}

double Distance(const TargetPoint& a, const TargetPoint& b) {
  return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m, a.z_m - b.z_m);
}

// All within kMinWidthShare of the line through the first and the one farthest from it.
bool AreOnOneLine(const std::vector<TargetPoint>& points) {
  const TargetPoint& first = points[0];
  const auto nearer = [&first](const TargetPoint& a, const TargetPoint& b) {
    return Distance(first, a) < Distance(first, b);
  };
  const TargetPoint& farthest = *std::ranges::max_element(points, nearer);
  const double length = Distance(first, farthest);
  const double x = farthest.x_m - first.x_m, y = farthest.y_m - first.y_m,
               z = farthest.z_m - first.z_m;
  return std::ranges::all_of(points, [&](const TargetPoint& point) {
    const double u = point.x_m - first.x_m, v = point.y_m - first.y_m, w = point.z_m - first.z_m;
    const double area = std::hypot(y * w - z * v, z * u - x * w, x * v - y * u);
    return area <= kMinWidthShare * length * length;
  });
}

void CheckPoints(const Target& target, FaultList* faults) {
  const std::vector<TargetPoint>& points = target.points;
  const bool is_static = target.IsStatic(), have_positions = !is_static || target.is_surveyed;
  const char* const what = !is_static           ? "a rigid target has "
                           : target.is_surveyed ? "a survey of static points has "
                                                : "static points are ";
  if (!target.marker_positions_m.empty()) {
    faults->Add(what, "points, not positions along a wand");
  }
  const int fewest = have_positions ? kMinLabelledPoints : 1;
  if (points.size() < static_cast<size_t>(fewest) || points.size() > kMaxMarkers) {
    faults->Add(what, fewest, " to ", kMaxMarkers, " points, not ", points.size());
    return;
  }
  std::set<std::string> labels;
  bool all_good = true;
  for (size_t i = 0; i < points.size(); ++i) {
    const std::string shown = absl::CHexEscape(points[i].label.substr(0, kMaxLabelLength));
    const std::string why = TargetPointFault(points[i]);
    all_good = all_good && why.empty();
    if (!why.empty()) faults->Add("point ", shown, ": ", why);
    if (!labels.insert(points[i].label).second) faults->Add("label ", shown, " is given twice");
    if (!have_positions) continue;
    for (size_t j = 0; j < i; ++j) {
      if (Distance(points[i], points[j]) >= kMinSpanM) continue;
      faults->Add("points ", absl::CHexEscape(points[j].label.substr(0, kMaxLabelLength)), " and ",
                  shown, " are at the same place");
      break;
    }
  }
  if (!all_good || !have_positions || !AreOnOneLine(points)) return;
  if (is_static) {
    faults->Add(
        "all surveyed points are on one line, which does not fix the rig: survey one beside it, or "
        "give labels alone");
  } else {
    faults->Add(
        "all points are on one line: its turn about that line cannot be seen; describe it "
        "as wand:0,0.13,0.39, with positions along the line");
  }
}

// Its points are those of the board that it says it is.
void CheckBoard(const Target& target, FaultList* faults) {
  if (target.board.empty()) return;
  const absl::StatusOr<Board> board = ParseBoard(target.board);
  if (!board.ok()) {
    faults->Add(std::string(board.status().message()));
    return;
  }
  const double sigma_m = target.points.empty() ? 0 : target.points[0].sigma_m;
  const absl::StatusOr<Target> meant = MakeBoardTarget(*board, sigma_m);
  if (!meant.ok()) {
    faults->Add(std::string(meant.status().message()));
  } else if (target.kind != TargetKind::kRigid || meant->board != target.board ||
             meant->points != target.points) {
    faults->Add("its points are not those of ", target.board);
  }
}

void CheckPositions(const Target& target, FaultList* faults) {
  const std::vector<double>& positions = target.marker_positions_m;
  if (!target.points.empty()) faults->Add("only a rigid target and static points have points");
  if (positions.size() > kMaxWandMarkers) {
    faults->Add(positions.size(), " markers, at most ", kMaxWandMarkers);
  }
  if (target.kind == TargetKind::kPoint && positions.size() != 1) {
    faults->Add("a point has one marker, not ", positions.size());
  }
  if (target.kind == TargetKind::kWand && positions.size() < 2) {
    faults->Add("a wand needs at least two distinct marker positions");
  }
  if (!positions.empty() && positions[0] != 0) {
    faults->Add("the first marker is at ", positions[0], " m, it must be at 0");
  }
  for (size_t i = 0; i < positions.size(); ++i) {
    if (!std::isfinite(positions[i])) {
      faults->Add("position ", i, " is ", positions[i], ", not finite");
    } else if (i > 0 && !(positions[i] - positions[i - 1] >= kMinSpanM)) {
      faults->Add("positions must increase by at least ", kMinSpanM, " m, position ", i, " is ",
                  positions[i], " after ", positions[i - 1]);
    }
  }
  if (!positions.empty() && positions.back() > kMaxLengthM) {
    faults->Add("the wand is ", positions.back(), " m long, at most ", kMaxLengthM,
                ": positions are in metres");
  }
}

}  // namespace

void AddOptions(Target* target, OptionTable* table) {
  table->Add("diameter", &target->diameter_m, {0, kMaxDiameterM, "m"}, "of the spheres");
  table->Add("hz", &target->blink_hz, {kAboveZero, kMaxBlinkHz, "Hz"}, "of each marker");
  table->Add("tolerance", &target->span_tolerance_m, {kAboveZero, kMaxToleranceM, "m"},
             "one sigma of each span");
}

std::string TargetPointFault(const TargetPoint& point) {
  const auto is_plain = [](char c) {
    return absl::ascii_isgraph(static_cast<unsigned char>(c)) &&
           std::string_view(",;|{}#").find(c) == std::string_view::npos;
  };
  if (point.label.empty() || point.label.size() > kMaxLabelLength ||
      !std::ranges::all_of(point.label, is_plain)) {
    return absl::StrCat("a label is 1 to ", kMaxLabelLength,
                        " printable ASCII characters without , ; | { } # and spaces");
  }
  for (const double value : {point.x_m, point.y_m, point.z_m}) {
    if (!(std::abs(value) <= kMaxLengthM)) {
      return absl::StrCat("a coordinate is ", value, " m, at most ", kMaxLengthM,
                          ": points are in metres");
    }
  }
  if (!(point.sigma_m >= 0) || point.sigma_m > kMaxPointSigmaM) {
    return absl::StrCat("the sigma is ", point.sigma_m, " m, it must be 0 to ", kMaxPointSigmaM);
  }
  return "";
}

absl::Status Target::Validate() const {
  FaultList faults;
  if (!IsLine() && kind != TargetKind::kRigid && !IsStatic()) {
    faults.Add("target kind ", static_cast<int>(kind), " is unknown");
  }
  if (is_surveyed && !IsStatic()) faults.Add("only static points are surveyed");
  if (kind == TargetKind::kRigid || IsStatic()) {
    CheckPoints(*this, &faults);
  } else {
    CheckPositions(*this, &faults);
  }
  CheckBoard(*this, &faults);
  CheckOptions(*this, &faults);
  if (blink_hz.size() > 1 && blink_hz.size() != static_cast<size_t>(marker_count())) {
    faults.Add(blink_hz.size(), " blink frequencies for ", marker_count(),
               " markers, give one for all or one for each");
  }
  return faults.Result();
}

absl::Status CheckDetectable(const Target& target) {
  if (target.IsLine() || !target.board.empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      "the detectors find wands, single markers and printed boards, not labelled points: detect "
      "its "
      "points with another program and give them as a file of markers (<camera>.csv)");
}

absl::Status CheckIsLine(const Target& target) {
  if (target.IsLine()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      "only wands and single markers can be found in events, rendered, and tuned for; the target "
      "is made of labelled points");
}

absl::StatusOr<Target> MakeBoardTarget(const Board& board, double sigma_m) {
  if (board.HasTwin()) {
    return absl::InvalidArgumentError(absl::StrCat(
        FormatBoard(board),
        " looks the same when it is turned by 180 degrees, so that two cameras "
        "would take different corners for the first: of a checker, take one count even and one "
        "odd (9x6), or take circles with an odd number of rows (board:circles,4x11,0.02)"));
  }
  if (board.point_count() > kMaxMarkers) {
    return absl::InvalidArgumentError(
        absl::StrCat(FormatBoard(board), " has ", board.point_count(), " points",
                     board.IsTwoSided() ? " on both sides" : "", ", a target has at most ",
                     kMaxMarkers, ": take one with fewer, larger ",
                     board.HasCircles()                    ? "circles"
                     : board.kind == BoardKind::kAprilGrid ? "tags"
                                                           : "squares"));
  }
  Target target;
  target.kind = TargetKind::kRigid;
  target.board = FormatBoard(board);
  for (const Eigen::Vector3d& point : board.Points()) {
    const bool is_back = board.SideOf(target.points.size()) == BoardSide::kBack;
    const int index = static_cast<int>(target.points.size()) % board.side_point_count();
    target.points.push_back(
        {absl::StrCat(is_back ? "back-c" : "c", index % board.columns, "r", index / board.columns),
         point.x(), point.y(), point.z(), sigma_m});
  }
  return target;
}

absl::StatusOr<Target> ParseTarget(std::string_view text) {
  if (text.size() > kMaxTextLength) return Refuse(text, "too long");
  Target target;
  const absl::Status status = ParseParts(text, &target);
  if (!status.ok()) return Refuse(text, std::string(status.message()));
  return target;
}

std::string FormatTarget(const Target& target) {
  const std::string options = FormatOptions(target);
  std::string text = "point";
  if (target.kind == TargetKind::kWand) {
    const auto append = [](std::string* out, double value) { out->append(ShortestText(value)); };
    text = absl::StrCat("wand:", absl::StrJoin(target.marker_positions_m, ",", append));
  }
  if (!target.board.empty()) {
    const double sigma_m = target.points.empty() ? kBoardSigmaM : target.points[0].sigma_m;
    text = target.board;
    if (sigma_m != kBoardSigmaM) absl::StrAppend(&text, ";flatness=", ShortestText(sigma_m));
  } else if (!target.IsLine()) {
    std::vector<std::string> points;
    for (const TargetPoint& point : target.points) {
      if (target.IsStatic() && !target.is_surveyed) {
        points.push_back(point.label);
        continue;
      }
      points.push_back(absl::StrCat(point.label, " ", ShortestText(point.x_m), " ",
                                    ShortestText(point.y_m), " ", ShortestText(point.z_m), " ",
                                    ShortestText(point.sigma_m)));
    }
    text =
        absl::StrCat(target.IsStatic() ? "static:{" : "rigid:{", absl::StrJoin(points, "|"), "}");
  }
  return absl::StrCat(text, options.empty() ? "" : ";", options);
}

}  // namespace rigcal
