// SPDX-License-Identifier: Apache-2.0
#include "server/standby/promote_command.h"

#include <cstdio>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/text/printable.h"
#include "server/care/running_server.h"
#include "server/replica/data_role.h"
#include "server/rpc/replication_client.h"
#include "server/store/factory/open_store.h"

namespace rigcal::server {
namespace {

// Where no standby runs.
absl::StatusOr<Promotion> PromoteFolder(const std::string& data_dir, bool force) {
  RIGCAL_ASSIGN_OR_RETURN(DataRole role, ReadDataRole(data_dir));
  if (role.role != RoleOfData::kStandby) {
    return absl::FailedPreconditionError(
        absl::StrCat(data_dir, " is no standby's data folder; name that one with --data-dir"));
  }
  if (!force) {
    RIGCAL_ASSIGN_OR_RETURN(const auto link, LinkToPrimary(role.primary));
    if (link->Answers()) {
      return absl::FailedPreconditionError(
          absl::StrCat("the primary ", role.primary,
                       " answers: two servers must not serve the same data. Stop it, or promote "
                       "with --force: then it is told to stop as soon as it can be reached"));
    }
    if (!role.complete) {
      return absl::FailedPreconditionError(
          absl::StrCat("this standby has never had all data of ", role.primary,
                       "; promote with --force to go on with what it has"));
    }
  }
  RIGCAL_ASSIGN_OR_RETURN(const auto store, OpenStore(data_dir));
  RIGCAL_ASSIGN_OR_RETURN(role.generation, store->replica_target()->RaiseGeneration());
  role.role = RoleOfData::kPromoted;
  RIGCAL_RETURN_IF_ERROR(WriteDataRole(data_dir, role));
  return Promotion{
      .generation = role.generation, .primary = role.primary, .silence_s = -1, .missing_count = 0};
}

}  // namespace

PromoteCommand::PromoteCommand(CLI::App* app)
    : promote_(app->add_subcommand(
          "promote",
          "Make a standby (--follow) take over from its primary, at once; --data-dir names its "
          "folder")) {
  promote_->add_flag("--force", force_,
                     "Even though the primary answers, or parts of its data are missing here");
}

int PromoteCommand::Run(const std::string& data_dir) const {
  bool runs = true;
  absl::StatusOr<Promotion> promotion = absl::UnavailableError("");
  if (const auto address = AddressOfRunningServer(data_dir); address.ok()) {
    promotion = PromoteRunningServer(*address, force_);
  }
  if (absl::IsUnavailable(promotion.status())) {
    runs = false;
    promotion = PromoteFolder(data_dir, force_);
  }
  if (!promotion.ok()) {
    std::fprintf(stderr, "rigcal-server: %s\n",
                 PrintableLines(std::string(promotion.status().message())).c_str());
    return 1;
  }
  std::printf("%s has taken over from %s with generation %s\n", data_dir.c_str(),
              promotion->primary.c_str(), absl::StrCat(promotion->generation).c_str());
  if (promotion->missing_count > 0) {
    std::printf(
        "%s observations that it knows of were not copied yet; agents with --durable-on standby "
        "send them again, others are named in the counts of their sessions\n",
        absl::StrCat(promotion->missing_count).c_str());
  }
  std::printf(runs ? "it serves now; start it without --follow from now on\n"
                   : "no server runs on it: start rigcal-server without --follow\n");
  return 0;
}

}  // namespace rigcal::server
