// SPDX-License-Identifier: Apache-2.0
#include "client/results/scale_report.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/output/console.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {
namespace {

std::string PercentOf(double share, int digits) { return FormatFixed(100 * share, digits); }

}  // namespace

std::string FormatScale(const ScaleReport& report) {
  TextTable table;
  table.Words({"source"})
      .Numbers({"change", "one sigma"}, "of every length by itself (%)")
      .Numbers({"difference (%)", "sigmas"}, "from the others together");
  for (const ScaleResidual& residual : report.fusion.residuals) {
    table.AddRow({Printable(residual.name), PercentOf(residual.own_change_rel, 3),
                  PercentOf(residual.own_sigma_rel, 3), PercentOf(residual.from_others_rel, 3),
                  FormatFixed(residual.from_others_sigmas, 1)});
  }
  std::string text = table.Format();
  if (report.output.empty()) return text;
  absl::StrAppend(&text, "every length of ", Printable(report.calibration), " times ",
                  FormatFixed(report.fusion.factor, 6), ", one sigma ",
                  PercentOf(report.fusion.sigma_rel, 4), " %; written to ",
                  Printable(report.output), "\n");
  return text;
}

std::string ToJson(const ScaleReport& report) {
  nlohmann::ordered_json json = {{"calibration", report.calibration},
                                 {"output", report.output},
                                 {"factor", report.fusion.factor},
                                 {"sigma_rel", report.fusion.sigma_rel},
                                 {"disagrees", ""},
                                 {"undecided", report.fusion.undecided},
                                 {"sources", nlohmann::ordered_json::array()}};
  if (report.fusion.odd >= 0) {
    json["disagrees"] = report.fusion.residuals[static_cast<size_t>(report.fusion.odd)].name;
  }
  for (const ScaleResidual& residual : report.fusion.residuals) {
    json["sources"].push_back({{"name", residual.name},
                               {"own_change_rel", residual.own_change_rel},
                               {"own_sigma_rel", residual.own_sigma_rel},
                               {"from_others_rel", residual.from_others_rel},
                               {"from_others_sigmas", residual.from_others_sigmas}});
  }
  return JsonText(json);
}

std::string DisagreementOf(const ScaleFusion& fusion) {
  if (fusion.undecided) {
    const ScaleResidual& a = fusion.residuals[static_cast<size_t>(fusion.suspects[0])];
    const ScaleResidual& b = fusion.residuals[static_cast<size_t>(fusion.suspects[1])];
    return absl::StrCat("\"", a.name, "\" and \"", b.name, "\" disagree: the one is ",
                        PercentOf(a.from_others_rel, 2), " % from what the rest says (",
                        FormatFixed(std::abs(a.from_others_sigmas), 1), " sigmas), the other ",
                        PercentOf(b.from_others_rel, 2), " % (",
                        FormatFixed(std::abs(b.from_others_sigmas), 1),
                        " sigmas), and nothing says which of them is wrong: measure both again, or "
                        "a third, or leave one out; nothing was written");
  }
  if (fusion.odd < 0) return "";
  const ScaleResidual& odd = fusion.residuals[static_cast<size_t>(fusion.odd)];
  return absl::StrCat("\"", odd.name, "\" disagrees with the other sources of the scale: ",
                      PercentOf(std::abs(odd.from_others_rel), 2), " % ",
                      odd.from_others_rel > 0 ? "longer" : "shorter", " (",
                      FormatFixed(std::abs(odd.from_others_sigmas), 1),
                      " sigmas); measure it again, or go on with --leave-out \"", odd.name,
                      "\"; nothing was written");
}

}  // namespace rigcal::client
