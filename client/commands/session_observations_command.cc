// SPDX-License-Identifier: Apache-2.0
#include "client/commands/session_observations_command.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/net/server_connection.h"
#include "common/wire/observation_wire.h"

namespace rigcal::client {
namespace {

using SessionStub = v1::SessionService::Stub;

// For the whole of a long recording over a slow link.
constexpr std::chrono::milliseconds kReadTimeout{3'600'000};

void WriteObservationHead(uint32_t marker_count, std::ostream& out) {
  std::string line = "camera,stream_epoch,seq,clock_epoch,time_ns";
  for (uint32_t m = 0; m < marker_count; ++m) absl::StrAppend(&line, ",x", m, "_px,y", m, "_px");
  out << line << "\n";
}

void WriteObservationRows(const ObservationBatch& batch, std::ostream& out) {
  for (size_t row = 0; row < batch.rows(); ++row) {
    std::string line =
        absl::StrCat(batch.stream.camera, ",", batch.stream.stream_epoch, ",",
                     batch.first_seq + row, ",", batch.clock_epoch, ",", batch.time_ns[row]);
    for (uint32_t m = 0; m < batch.marker_count; ++m) {
      const size_t i = row * batch.marker_count + m;
      const bool visible = (batch.visible_mask[row] >> m & 1U) != 0;
      line += visible ? absl::StrFormat(",%.9g,%.9g", batch.x_px[i], batch.y_px[i]) : ",,";
    }
    out << line << "\n";
  }
}

}  // namespace

ExitCode WriteSessionObservations(const SessionObservationsOptions& options,
                                  CommandContext& context) {
  ServerConnection server(context.server);
  Console& console = context.console;
  const auto session = SessionOf(server.CallWithId(&SessionStub::GetSession, options.session));
  if (!session.ok()) return context.Fail(session.status());
  if (console.format == OutputFormat::kTable) {
    WriteObservationHead(static_cast<uint32_t>(session->target().marker_positions_m_size()),
                         console.out);
  }

  v1::ReadObservationsRequest request;
  request.set_session_id(options.session);
  request.set_camera(options.camera);
  request.set_include_late(options.include_late);
  absl::Status fault;
  const absl::Status status =
      server.Read(&SessionStub::ReadObservations, request, kReadTimeout,
                  [&](const v1::ReadObservationsResponse& response) {
                    const v1::ObservationBatch& message = response.batch();
                    if (console.format == OutputFormat::kJson) {
                      console.out << ToJson(message, /*indented=*/false) << "\n";
                      return console.out.good();
                    }
                    const absl::StatusOr<ObservationBatch> batch = wire::FromProto(message);
                    fault = batch.status();
                    if (batch.ok()) WriteObservationRows(*batch, console.out);
                    return batch.ok() && console.out.good();
                  });
  console.out.flush();
  if (!status.ok()) return context.Fail(status);
  if (!fault.ok()) {
    return context.Fail(
        absl::DataLossError(absl::StrCat("the server sent a batch of session ", options.session,
                                         " that cannot be read: ", std::string(fault.message()))));
  }
  return ExitCode::kOk;
}

}  // namespace rigcal::client
