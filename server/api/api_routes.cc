// SPDX-License-Identifier: Apache-2.0
#include "server/api/api_routes.h"

#include <optional>
#include <utility>

#include "absl/strings/str_split.h"

namespace rigcal::server {
namespace {

constexpr ApiRoute kApiRoutes[] = {
    {"GET", "/v1/status", "/rigcal.v1.StatusService/GetStatus",
     "Version, load and health of the server"},
    {"GET", "/v1/live", "/rigcal.v1.LiveService/GetLive",
     "The rig while somebody waves, or what of it has changed since a revision"},
    {"GET", "/v1/rigs", "/rigcal.v1.RigService/ListRigs",
     "All rigs, with their active calibration"},
    {"GET", "/v1/rigs/{name}", "/rigcal.v1.RigService/GetRig", "One rig"},
    {"GET", "/v1/rigs/{rig}/activations", "/rigcal.v1.RigService/ListActivations",
     "Which calibrations of a rig were active, newest first"},
    {"POST", "/v1/rigs/{name}:rollback", "/rigcal.v1.RigService/RollbackRig",
     "Makes the calibration before the active one active again"},
    {"POST", "/v1/rigs/{name}:monitor", "/rigcal.v1.RigService/SetRigMonitor",
     "Whether the server compares the sessions of a rig with its active calibration"},
    {"GET", "/v1/sessions", "/rigcal.v1.SessionService/ListSessions", "A page of the sessions"},
    {"POST", "/v1/sessions", "/rigcal.v1.SessionService/CreateSession", "Creates a session"},
    {"GET", "/v1/sessions/{id}", "/rigcal.v1.SessionService/GetSession", "One session"},
    {"DELETE", "/v1/sessions/{id}", "/rigcal.v1.SessionService/DeleteSession",
     "Removes a session and its observations"},
    {"POST", "/v1/sessions:prune", "/rigcal.v1.SessionService/PruneSessions",
     "Deletes the observations of old sessions"},
    {"POST", "/v1/sessions/{id}:start", "/rigcal.v1.SessionService/StartSession",
     "Starts a session"},
    {"POST", "/v1/sessions/{id}:stop", "/rigcal.v1.SessionService/StopSession", "Stops a session"},
    {"POST", "/v1/sessions/{id}:discard", "/rigcal.v1.SessionService/DiscardSession",
     "Marks a session as thrown away, or takes that back"},
    {"GET", "/v1/sessions/{session_id}/lenses/{camera}", "/rigcal.v1.LensService/GetLens",
     "The lens of a camera from the board that a session has seen"},
    {"GET", "/v1/calibrations", "/rigcal.v1.CalibrationService/ListCalibrations",
     "A page of the calibrations"},
    {"POST", "/v1/calibrations", "/rigcal.v1.CalibrationService/CreateCalibration",
     "Queues a calibration"},
    {"GET", "/v1/calibrations/{id}", "/rigcal.v1.CalibrationService/GetCalibration",
     "One calibration"},
    {"DELETE", "/v1/calibrations/{id}", "/rigcal.v1.CalibrationService/DeleteCalibration",
     "Removes a calibration that has ended"},
    {"POST", "/v1/calibrations/{id}:activate", "/rigcal.v1.RigService/ActivateCalibration",
     "Makes a calibration the active one of its rig"},
    {"GET", "/v1/calibrations/{id_a}/differences/{id_b}",
     "/rigcal.v1.CalibrationService/CompareCalibrations",
     "Which cameras moved from one calibration to another"},
    {"POST", "/v1/calibrations/{id}:cancel", "/rigcal.v1.CalibrationService/CancelCalibration",
     "Stops a queued or running calibration"},
    {"GET", "/v1/calibrations/{id}/accuracy", "/rigcal.v1.CalibrationService/GetAccuracy",
     "Expected error over the waved volume"},
    {"POST", "/v1/calibrations/{id}:accuracy", "/rigcal.v1.CalibrationService/GetAccuracy",
     "Expected error at given points"},
    {"GET", "/v1/calibrations/{id}/residuals", "/rigcal.v1.CalibrationService/GetResiduals",
     "Residual vectors over the image and their histogram, by camera"},
    {"GET", "/v1/calibrations/{id}/information", "/rigcal.v1.CalibrationService/ExplainCalibration",
     "Which sessions, spans of time and cameras hold which parameter"},
    {"GET", "/v1/calibrations/{id}/exports", "/rigcal.v1.CalibrationService/ListExports",
     "The formats in which a calibration can be exported"},
    {"GET", "/v1/calibrations/{id}/exports/{format}",
     "/rigcal.v1.CalibrationService/ExportCalibration",
     "A calibration in one of the formats, as a file", "content", "*/*"},
    {"GET", "/v1/agents", "/rigcal.v1.AgentService/ListAgents", "A page of the agents"},
    {"GET", "/v1/cameras/{camera}/preview.jpg", "/rigcal.v1.CameraService/GetPreview",
     "The next frame of a camera with the detection drawn into it", "jpeg", "image/jpeg"},
    {"POST", "/v1/cameras/{camera}:move", "/rigcal.v1.CameraService/MoveCamera",
     "Gives a camera to another agent"},
    {"POST", "/v1/cameras/{camera}:use", "/rigcal.v1.CameraService/UseCamera",
     "Chooses a camera that an agent offers"},
    {"POST", "/v1/cameras/{camera}:drop", "/rigcal.v1.CameraService/DropCamera",
     "Ends the use of a chosen camera"},
    {"GET", "/v1/cameras/{camera}/detector", "/rigcal.v1.CameraService/GetDetector",
     "The colour that a camera's detector looks for, what it ignores, what it learns"},
    {"POST", "/v1/cameras/{camera}/detector:learn_mask", "/rigcal.v1.CameraService/LearnMask",
     "Begins to learn which static bright spots a detector ignores"},
    {"POST", "/v1/cameras/{camera}/detector:clear_mask", "/rigcal.v1.CameraService/ClearMask",
     "Forgets the learnt mask"},
    {"POST", "/v1/cameras/{camera}/detector:tune", "/rigcal.v1.CameraService/TuneDetector",
     "Begins to learn the colour of the wand"},
    {"POST", "/v1/cameras/{camera}/detector:set_colour",
     "/rigcal.v1.CameraService/SetDetectorColour", "Sets the colour of the wand"},
    {"GET", "/v1/tokens", "/rigcal.v1.IdentityService/ListTokens", "All tokens"},
    {"POST", "/v1/tokens", "/rigcal.v1.IdentityService/CreateToken", "Makes a join string"},
    {"POST", "/v1/tokens/{id}:revoke", "/rigcal.v1.IdentityService/RevokeToken",
     "Revokes a token, and who joined or signed in with it"},
    {"GET", "/v1/identities", "/rigcal.v1.IdentityService/ListIdentities", "Who has joined"},
    {"POST", "/v1/identities:revoke", "/rigcal.v1.IdentityService/Revoke",
     "Revokes an agent or a user"},
};

constexpr RpcWithoutRoute kRpcsWithoutRoute[] = {
    {"/grpc.health.v1.Health/Check", "GET /readyz"},
    {"/grpc.health.v1.Health/Watch", "GET /readyz"},
    {"/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", "GET /v1/openapi.json"},
    {"/rigcal.v1.CalibrationService/WatchCalibration",
     "a stream; poll GET /v1/calibrations/{id}, which answers 304 while nothing has changed"},
    {"/rigcal.v1.IngestService/Connect", "for agents, which speak gRPC"},
    {"/rigcal.v1.IngestService/UploadBatch", "for agents, which speak gRPC"},
    {"/rigcal.v1.MaintenanceService/Compact",
     "minutes of progress messages; rigcal-server compact"},
    {"/rigcal.v1.ReplicationService/ListChanges", "for a standby, which speaks gRPC"},
    {"/rigcal.v1.ReplicationService/Promote", "on the standby's PC; rigcal-server promote"},
    {"/rigcal.v1.ReplicationService/ReadRecord", "for a standby, which speaks gRPC"},
    {"/rigcal.v1.ReplicationService/Supersede", "for a standby that has taken over"},
    {"/rigcal.v1.SessionService/ReadObservations",
     "gigabytes as packed columns, which JSON makes several times as large; gRPC streams them"},
    {"/rigcal.v1.SessionService/WatchSession",
     "a stream; poll GET /v1/live, which answers 304 while nothing has changed"},
    {"/rigcal.v1.TriangulationService/Triangulate", "a stream in both directions"},
};

// "{id}:start" against "s-1:start" gives ("id", "s-1"). A value has no ':' of its own, so that a
// verb is never taken for a part of it. False: they differ.
bool MatchSegment(std::string_view pattern, const std::string& segment,
                  std::vector<UrlParameter>* variables) {
  if (!pattern.starts_with('{')) return pattern == segment;
  const size_t end = pattern.find('}');
  const std::string_view verb = pattern.substr(end + 1);
  if (segment.size() <= verb.size() || !std::string_view(segment).ends_with(verb)) return false;
  std::string value = segment.substr(0, segment.size() - verb.size());
  if (value.find(':') != std::string::npos) return false;
  variables->push_back({std::string(pattern.substr(1, end - 1)), std::move(value)});
  return true;
}

}  // namespace

absl::Span<const ApiRoute> ApiRoutes() { return kApiRoutes; }
absl::Span<const RpcWithoutRoute> RpcsWithoutRoute() { return kRpcsWithoutRoute; }

std::vector<std::string> VariablesOf(std::string_view path) {
  std::vector<std::string> names;
  for (size_t begin = path.find('{'); begin != std::string_view::npos;
       begin = path.find('{', begin + 1)) {
    names.emplace_back(path.substr(begin + 1, path.find('}', begin) - begin - 1));
  }
  return names;
}

ApiMatch MatchApiRoute(std::string_view method, std::string_view path) {
  ApiMatch match;
  std::vector<std::string> segments;
  // Taken apart before it is decoded: an encoded '/' is a part of a name.
  for (const absl::string_view part :
       absl::StrSplit(absl::string_view(path.data(), path.size()), '/')) {
    std::optional<std::string> segment = DecodeUrlText({part.data(), part.size()}, false);
    if (!segment) return match;
    segments.push_back(*std::move(segment));
  }
  for (const ApiRoute& route : kApiRoutes) {
    const std::vector<std::string> patterns =
        absl::StrSplit(absl::string_view(route.path.data(), route.path.size()), '/');
    if (patterns.size() != segments.size()) continue;
    std::vector<UrlParameter> variables;
    bool same = true;
    for (size_t i = 0; same && i < patterns.size(); ++i) {
      same = MatchSegment(patterns[i], segments[i], &variables);
    }
    if (!same) continue;
    if (!match.allowed_methods.empty()) match.allowed_methods += ", ";
    match.allowed_methods += route.method;
    if (route.method != method) continue;
    match.route = &route;
    match.variables = std::move(variables);
  }
  return match;
}

}  // namespace rigcal::server
