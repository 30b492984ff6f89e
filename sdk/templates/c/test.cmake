# Runs the plugin in arhost for five frames; all of them must pass through it.
execute_process(COMMAND ${ARHOST} --config try.yaml --frames 5 --set @SECTION@.plugin=${PLUGIN}
                WORKING_DIRECTORY ${CMAKE_CURRENT_LIST_DIR} COMMAND_ERROR_IS_FATAL ANY)
file(READ ${CMAKE_CURRENT_LIST_DIR}/out/stats.json stats)
string(JSON count GET "${stats}" frames @COUNT@)
if(NOT count EQUAL 5)
  message(FATAL_ERROR "frames.@COUNT@ in out/stats.json is ${count}, must be 5")
endif()
