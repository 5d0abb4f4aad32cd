// SPDX-License-Identifier: Apache-2.0
#include "client/results/scale_report.h"

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/output/console.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "common/scale/unit_ratio.h"

namespace rigcal::client {
namespace {

std::string PercentOf(double share, int digits) { return FormatFixed(100 * share, digits); }

// "0.100 %"; of what is no small change the factor: "1/1000 as long".
std::string ChangeOf(double change_rel) {
  const double ratio = 1 + change_rel;
  const bool small = ratio > 0.5 && ratio < 2;
  return small ? PercentOf(change_rel, 3) + " %" : DescribeRatio(ratio);
}

}  // namespace

std::string FormatScale(const ScaleReport& report) {
  TextTable table;
  table.Words({"source"})
      .Numbers({"change", "one sigma"}, "of every length by itself")
      .Numbers({"difference", "sigmas"}, "from the others together");
  for (const ScaleResidual& residual : report.fusion.residuals) {
    table.AddRow({Printable(residual.name), ChangeOf(residual.own_change_rel),
                  PercentOf(residual.own_sigma_rel, 3) + " %", ChangeOf(residual.from_others_rel),
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

}  // namespace rigcal::client
