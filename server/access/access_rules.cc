// SPDX-License-Identifier: Apache-2.0
#include "server/access/access_rules.h"

#include <algorithm>
#include <iterator>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

constexpr RoleSet kEverybody = {Role::kAgent, Role::kOperator, Role::kViewer, Role::kAdmin};
constexpr RoleSet kReaders = {Role::kOperator, Role::kViewer, Role::kAdmin};
constexpr RoleSet kOperators = {Role::kOperator, Role::kAdmin};
constexpr RoleSet kAdmins = {Role::kAdmin};

constexpr AccessRule kAccessRules[] = {
    {"/grpc.health.v1.Health/Check", kEverybody},
    {"/grpc.health.v1.Health/Watch", kEverybody},
    {"/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", kReaders},
    {"/rigcal.v1.AgentService/ListAgents", kReaders},
    {"/rigcal.v1.CalibrationService/CancelCalibration", kOperators, true},
    {"/rigcal.v1.CalibrationService/CompareCalibrations", kReaders},
    {"/rigcal.v1.CalibrationService/CreateCalibration", kOperators, true},
    {"/rigcal.v1.CalibrationService/DeleteCalibration", kOperators, true},
    {"/rigcal.v1.CalibrationService/ExplainCalibration", kReaders},
    {"/rigcal.v1.CalibrationService/ExportCalibration", kReaders},
    {"/rigcal.v1.CalibrationService/GetAccuracy", kReaders},
    {"/rigcal.v1.CalibrationService/GetCalibration", kReaders},
    {"/rigcal.v1.CalibrationService/GetResiduals", kReaders},
    {"/rigcal.v1.CalibrationService/ListCalibrations", kReaders},
    {"/rigcal.v1.CalibrationService/ListExports", kReaders},
    {"/rigcal.v1.CalibrationService/WatchCalibration", kReaders},
    {"/rigcal.v1.CameraService/ClearMask", kOperators, true},
    {"/rigcal.v1.CameraService/DropCamera", kOperators, true},
    {"/rigcal.v1.CameraService/GetDetector", kReaders},
    {"/rigcal.v1.CameraService/GetPreview", kReaders},
    {"/rigcal.v1.CameraService/LearnMask", kOperators, true},
    {"/rigcal.v1.CameraService/MoveCamera", kOperators, true},
    {"/rigcal.v1.CameraService/SetDetectorColour", kOperators, true},
    {"/rigcal.v1.CameraService/TuneDetector", kOperators, true},
    {"/rigcal.v1.CameraService/UseCamera", kOperators, true},
    {"/rigcal.v1.IdentityService/CreateToken", kAdmins, true},
    {"/rigcal.v1.IdentityService/ListIdentities", kAdmins},
    {"/rigcal.v1.IdentityService/ListTokens", kAdmins},
    {"/rigcal.v1.IdentityService/Revoke", kAdmins, true},
    {"/rigcal.v1.IdentityService/RevokeToken", kAdmins, true},
    // Which cameras: CheckAgent in server/session/stream_context_cache.h.
    {"/rigcal.v1.IngestService/Connect", {Role::kAgent}},
    {"/rigcal.v1.IngestService/UploadBatch", {Role::kAgent, Role::kOperator, Role::kAdmin}},
    {"/rigcal.v1.LensService/GetLens", kReaders},
    {"/rigcal.v1.LiveService/GetLive", kReaders},
    {"/rigcal.v1.MaintenanceService/Compact", kAdmins, true},
    {"/rigcal.v1.ReplicationService/ListChanges", kOperators},
    {"/rigcal.v1.ReplicationService/Promote", kAdmins, true},
    {"/rigcal.v1.ReplicationService/ReadRecord", kOperators},
    {"/rigcal.v1.ReplicationService/Supersede", kOperators, true},
    {"/rigcal.v1.RigService/ActivateCalibration", kOperators, true},
    {"/rigcal.v1.RigService/GetRig", kReaders},
    {"/rigcal.v1.RigService/ListActivations", kReaders},
    {"/rigcal.v1.RigService/ListRigs", kReaders},
    {"/rigcal.v1.RigService/RollbackRig", kOperators, true},
    {"/rigcal.v1.RigService/SetRigMonitor", kOperators, true},
    {"/rigcal.v1.SessionService/CreateSession", kOperators, true},
    {"/rigcal.v1.SessionService/DeleteSession", kOperators, true},
    {"/rigcal.v1.SessionService/DiscardSession", kOperators, true},
    {"/rigcal.v1.SessionService/GetSession", kReaders},
    {"/rigcal.v1.SessionService/ListSessions", kReaders},
    {"/rigcal.v1.SessionService/PruneSessions", kOperators, true},
    {"/rigcal.v1.SessionService/ReadObservations", kReaders},
    {"/rigcal.v1.SessionService/StartSession", kOperators, true},
    {"/rigcal.v1.SessionService/StopSession", kOperators, true},
    {"/rigcal.v1.SessionService/WatchSession", kReaders},
    {"/rigcal.v1.StatusService/GetStatus", kReaders},
    {"/rigcal.v1.TriangulationService/Triangulate", kReaders},
};

}  // namespace

std::string RoleSet::ToString() const {
  std::string text;
  for (const Role role : kRoles) {
    if (!contains(role)) continue;
    absl::StrAppend(&text, text.empty() ? "" : " or ", std::string(RoleName(role)));
  }
  return text.empty() ? "nobody" : text;
}

absl::Span<const AccessRule> AccessRules() { return kAccessRules; }

const AccessRule* FindAccessRule(std::string_view method) {
  const auto* const found = std::ranges::find(kAccessRules, method, &AccessRule::method);
  return found == std::end(kAccessRules) ? nullptr : found;
}

absl::Status CheckAccess(const Peer& peer, std::string_view method) {
  const AccessRule* rule = FindAccessRule(method);
  // The name is the caller's: it must not forge lines of a log.
  if (rule == nullptr) {
    if (!peer.has_certificate) return absl::OkStatus();  // gRPC says that it does not exist
    return absl::PermissionDeniedError(
        absl::StrCat(Describe(peer), " called an RPC for which this server has no rule"));
  }
  if (!peer.has_certificate || rule->roles.contains(peer.role)) return absl::OkStatus();
  // Who runs the server is its admin.
  const std::string what_to_do =
      rule->roles.contains(Role::kOperator)
          ? "rigcal token create --role operator, on the server's PC, makes a join string for it"
          : "do it on the server's PC, as the user who runs rigcal-server";
  return absl::PermissionDeniedError(
      absl::StrCat(Describe(peer), " has the role ", std::string(RoleName(peer.role)),
                   ", and this needs ", rule->roles.ToString(), " (",
                   std::string(rule->method.substr(rule->method.rfind('/') + 1)), "); ",
                   rule->roles.contains(Role::kAgent) && !rule->roles.contains(Role::kOperator)
                       ? "an agent does it: rigcal-agent join"
                       : what_to_do));
}

}  // namespace rigcal::server
