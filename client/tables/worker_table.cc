// SPDX-License-Identifier: Apache-2.0
#include "client/tables/worker_table.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {

std::string FormatWorkerList(const v1::GetStatusResponse& status, int64_t now_s) {
  if (status.workers().empty()) {
    return "nobody solves calibrations: the server is not to (solve.local = false), and no "
           "rigcal-worker was heard of within a day\n";
  }
  TextTable table;
  table.Words({"worker", "pc", "version", "calibration", "since", "heard of"});
  table.Numbers({"process"});
  for (const v1::SolveWorker& worker : status.workers()) {
    std::string state = absl::StrJoin(worker.calibration_ids(), ", ");
    if (!worker.is_alive()) {
      state = absl::StrCat("gone", state.empty() ? "" : ", had ", state);
    } else if (state.empty()) {
      state = "-";
    }
    const int64_t age_s = std::max<int64_t>(0, now_s - worker.heartbeat_time().seconds());
    table.AddRow({worker.is_server() ? "rigcal-server" : "rigcal-worker", worker.host(),
                  worker.software_version(), state, FormatTime(true, worker.start_time()),
                  worker.is_alive() ? std::string("now") : absl::StrCat(age_s, " s ago"),
                  worker.pid()});
  }
  return table.Format();
}

}  // namespace rigcal::client
