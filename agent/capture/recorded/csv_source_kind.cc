// SPDX-License-Identifier: Apache-2.0
#include <utility>
#include <vector>

#include "agent/capture/recorded/csv_observation_source.h"
#include "agent/capture/source_kind.h"

namespace rigcal::agent {

void AddOptions(CsvSourceOptions* options, OptionTable* table) {
  AddSpeed(&options->speed, table);
  table->Add("sigma", &options->sigma_px, {kAboveZero, kNoLimit, "px"},
             "one sigma of each coordinate of a centre");
  AddCalibration(&options->calibration_path, table);
  table->AddChoice("centres", &options->centre_kind,
                   std::vector<std::pair<std::string, CentreKind>>{
                       {"blob", CentreKind::kImageBlob}, {"sphere", CentreKind::kSphereCentre}},
                   "what the centres are: of the image blob, or of the projected sphere");
}

void ResolveOptions(const std::string& name, const std::string& subject,
                    CsvSourceOptions* options) {
  options->path = subject;
  options->camera = CameraNameOf(name, subject);
  ResolveCalibration(subject, &options->calibration_path);
}

extern const SourceKind kCsvSource;
constinit const SourceKind kCsvSource = {
    .name = "csv",
    .selector = "",
    .subject = "PATH",
    .subject_is_path = true,
    .required = "",
    .summary = "recorded marker centres, a CSV line for each observation",
    .example = "left=csv:rig/left.csv;speed=max;sigma=0.5",
    .make = MakeSpec<SpecOf<DirectSourceSpec, CsvObservationSource, CsvSourceOptions>>};

}  // namespace rigcal::agent
