// How values and messages read to people.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "google/protobuf/timestamp.pb.h"
#include "lightstage/v1/plan.pb.h"
#include "lightstage/v1/rig.pb.h"
#include "lightstage/v1/run.pb.h"

namespace lightstage::client {

// "12.3 GiB"
std::string BytesText(int64_t bytes);
// "1:02:03", rounded to seconds; "?" if it is not finite or negative.
std::string DurationText(double seconds);
// "33.75": at most `digits` decimals, without trailing zeros.
std::string NumberText(double value, int digits = 3);
// Local time, "2026-11-23 01:16:06".
std::string TimeText(const google::protobuf::Timestamp& time);

// Rows of cells with columns aligned, two blanks between, one line each.
std::string Table(const std::vector<std::vector<std::string>>& rows);

// "running", "paused", …
std::string StateText(v1::RunState state);
std::string LampsText(const google::protobuf::RepeatedPtrField<v1::LampLevel>& lamps);
std::string PatternText(const v1::Pattern& pattern);
// One line, without its end: "light stage: 32 azimuths over 180 deg, all lamps".
std::string PlanText(const v1::Plan& plan);
// "REASON: message"
std::string ReasonText(const v1::Reason& reason);

// Whole answers, lines with their ends.
std::string EstimateText(const v1::Plan& plan, const v1::EstimateRunResponse& estimate);
std::string RunText(const v1::Run& run);
std::string RunsText(const v1::ListRunsResponse& runs);
std::string RigText(const v1::Rig& rig);
std::string RigStateText(const v1::RigState& state);
std::string ShotText(const v1::Shot& shot);
// A line for each exposure that the camera adjusted; empty if none was.
std::string AdjustedText(const google::protobuf::RepeatedPtrField<v1::Exposure>& exposures);

}  // namespace lightstage::client
