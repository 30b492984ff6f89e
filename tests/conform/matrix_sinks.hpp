// SPDX-License-Identifier: Apache-2.0
//
// Each wrong sink of wrong/wrong_sink.cpp, and the tests that find it: these and no other.
#pragma once

#include "matrix.hpp"

namespace arhost::test {

inline const std::vector<WrongPlugin> wrong_sinks = {
    {"sink_none", "nothing", "pass", {}},
    {"sink_crash_in_start", "crashes in start", "crashed", {"sink.start"}},
    {"sink_crash_in_write", "crashes in write", "crashed", {"sink.write"}},
    {"sink_crash_in_idle", "crashes in idle", "crashed", {"sink.idle"}},
    {"sink_crash_in_stop", "crashes in stop", "crashed", {"sink.start"}},
    {"sink_crash_on_1x1", "crashes on a frame of one pixel", "crashed", {"sink.sizes"}},
    {"sink_crash_on_64_markers", "crashes on a frame with 64 markers", "crashed", {"sink.records"}},
    {"sink_crash_on_a_full_disk", "crashes on a full disk", "crashed", {"sink.full-disk"}},
    {"sink_writes_into_the_frame", "writes into the frame", "crashed", {"sink.write"}},
    {"sink_writes_into_the_record", "writes into the record", "crashed", {"sink.write"}},
    {"sink_reads_a_row_more", "reads a row behind the frame", "crashed", {"sink.write"}},
    {"sink_hang_in_start", "never returns from start", "timeout", {"sink.start"}},
    {"sink_hang_in_write", "never returns from write", "timeout", {"sink.write"}},
    {"sink_hangs_on_a_full_disk", "never returns from write on a full disk", "timeout", {"sink.full-disk"}},
    {"sink_status_0", "returns 0 from write", "fail", {"sink.write"}},
    {"sink_stop_fails", "stop fails for no reason", "fail", {"sink.start"}},
    {"sink_idle_fails", "idle fails for no reason", "fail", {"sink.idle"}},
    {"sink_refuses_odd_sizes_without_a_word", "refuses odd sizes without a word", "fail", {"sink.sizes"}},
    {"sink_wants_every_number", "refuses gaps in the frames' numbers", "fail", {"sink.gaps"}},
    {"sink_cancelled_is_internal", "write returns INTERNAL once cancelled", "fail", {"sink.cancelled"}},
    {"sink_start_cancelled_is_internal", "start returns INTERNAL once cancelled", "fail", {"sink.cancelled"}},
    {"sink_starts_once",
     "can't be started a second time",
     "fail",
     {"sink.sizes", "sink.cancelled", "sink.leaks", "sink.deterministic", "sink.last-frame", "sink.earlier-files",
      "sink.restart"}},
    {"sink_appends_to_an_old_log", "appends to an earlier run's log", "fail", {"sink.start-again"}},
    {"sink_mixes_instances", "writes into the files of another instance", "fail", {"sink.two-instances"}},
    {"sink_leaks_descriptors", "leaks a descriptor a frame", "fail", {"sink.leaks"}},
    {"sink_leaks_descriptors_in_start", "leaks a descriptor a start", "fail", {"sink.leaks"}},
    {"sink_leaks_memory", "leaks 256 KiB a frame", "fail", {"sink.leaks"}},
    {"sink_leaves_threads", "leaves a thread running with each frame", "fail", {"sink.leaks"}},
    {"sink_dates_its_files", "puts the date into its files", "fail", {"sink.deterministic"}},
    {"sink_rows_follow_each_other", "takes no notice of the stride", "fail", {"sink.stride"}},
    {"sink_drops_every_10th", "drops every tenth frame", "fail", {"sink.every-frame"}},
    {"sink_writes_frames_in_pairs", "writes two frames at a time, the later first", "fail", {"sink.every-frame"}},
    {"sink_keeps_all_to_its_end", "writes nothing before its end", "fail", {"sink.every-frame", "sink.restart"}},
    {"sink_writes_the_frame_before", "shows the frame before", "fail", {"sink.last-frame", "sink.restart"}},
    {"sink_empties_at_start", "empties an earlier run's log in start", "fail", {"sink.earlier-files"}},
    {"sink_looks_for_no_place", "start does not look whether it can write", "fail", {"sink.no-place"}},
    {"sink_half_files",
     "writes files under their own names piece by piece",
     "fail",
     {"sink.killed", "sink.full-disk"}},
    {"sink_forgets_on_restart", "empties its log once started again after a kill", "fail", {"sink.restart"}},
    {"sink_writes_twice_on_restart", "appends what comes again after a kill", "fail", {"sink.restart"}},
    {"sink_hides_a_full_disk", "returns OK on a full disk", "fail", {"sink.full-disk"}},
    {"sink_half_files_on_a_full_disk", "leaves half a file on a full disk", "fail", {"sink.full-disk"}},
    {"sink_slow", "takes 120 ms a frame", "warn", {"sink.speed"}},
};

} // namespace arhost::test
