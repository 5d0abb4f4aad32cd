// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/impl/service_type.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>

#include "server/audit/audit_log.h"
#include "server/identity/identity_authority.h"
#include "server/ingest/ingest.h"
#include "server/listen/listener.h"
#include "server/live/live_tracker.h"
#include "server/replica/standby_book.h"
#include "server/rpc/call_security.h"
#include "server/rpc/live_answers.h"
#include "server/rpc/observation_readers.h"
#include "server/rpc/watch_hub.h"
#include "server/session/agent_directory.h"
#include "server/session/agent_registry.h"
#include "server/session/calibration_runner.h"
#include "server/session/camera_choices.h"
#include "server/session/detector_broker.h"
#include "server/session/monitor_settings.h"
#include "server/session/preview_broker.h"
#include "server/session/retention.h"
#include "server/session/session_coordinator.h"
#include "server/store/server_roster.h"
#include "server/store/store.h"

namespace rigcal::server {

// Parts of the server that the services speak with; all must outlive them.
struct RpcServerParts {
  Store* store = nullptr;
  Ingest* ingest = nullptr;
  AgentDirectory* directory = nullptr;
  SessionCoordinator* coordinator = nullptr;
  CalibrationRunner* runner = nullptr;
  AgentRegistry* registry = nullptr;        // null: agents and cameras belong to nobody
  AuditLog* audit = nullptr;                // null: nothing is written
  IdentityAuthority* identities = nullptr;  // null: this server listens on its own PC only
  const Retention* retention = nullptr;     // null: nothing is ever deleted
  const LiveTracker* live = nullptr;        // null: there is no live state
  MonitorSettings* monitors = nullptr;      // null: no rig is monitored
  ServerRoster* roster = nullptr;           // null: no other server shares the store
  StandbyBook* standbys = nullptr;          // null: nobody follows this server
  std::filesystem::path data_dir = {};      // whose files a standby copies; empty: none
};

// The services of rigcal.v1 for clients; each in the file of its name.
std::unique_ptr<grpc::Service> MakeAgentService(const RpcServerParts& parts,
                                                const CameraChoices* choices);
std::unique_ptr<grpc::Service> MakeCameraService(const RpcServerParts& parts,
                                                 PreviewBroker* previews, DetectorBroker* detectors,
                                                 CameraChoices* choices);
std::unique_ptr<grpc::Service> MakeIdentityService(const RpcServerParts& parts);
std::unique_ptr<grpc::Service> MakeSessionService(const RpcServerParts& parts, WatchHub* watches,
                                                  ObservationReaders* readers);
std::unique_ptr<grpc::Service> MakeCalibrationService(const RpcServerParts& parts,
                                                      WatchHub* watches, CallSecurity* security);
std::unique_ptr<grpc::Service> MakeRigService(const RpcServerParts& parts, CallSecurity* security);
std::unique_ptr<grpc::Service> MakeLensService(Store* store);
std::unique_ptr<grpc::Service> MakeLiveService(LiveAnswers* answers);
std::unique_ptr<grpc::Service> MakeMaintenanceService(Store* store, WatchHub* watches);
// It has started at `start_utc_ns`. At most `max_connections` are open on `listener`.
std::unique_ptr<grpc::Service> MakeStatusService(const RpcServerParts& parts,
                                                 size_t ingest_queue_limit_bytes,
                                                 int64_t start_utc_ns, Listener* listener,
                                                 size_t max_connections);
std::unique_ptr<grpc::Service> MakeTriangulationService(Store* store);

}  // namespace rigcal::server
