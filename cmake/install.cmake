# SPDX-License-Identifier: Apache-2.0
# Install rules and the Debian package. All files are located relative to the programs, so the installation can be moved;
# therefore `lib` has no architecture suffix.
install(TARGETS arhost arhost-inprocess EXPORT arhost RUNTIME DESTINATION bin)
install(TARGETS arhost-conform arhost-launcher arhost-worker render-scene RUNTIME DESTINATION bin)
set_target_properties(arhost-inprocess PROPERTIES EXPORT_NAME inprocess)
install(TARGETS arhost-images LIBRARY DESTINATION lib/arhost)
# Plugins: see arhost_add_plugin.

# The SDK
install(DIRECTORY core/abi/include/ core/shading/include/ DESTINATION include)
install(TARGETS arhost-abi arhost-shading EXPORT arhost)
install(EXPORT arhost NAMESPACE arhost:: FILE arhostTargets.cmake DESTINATION lib/cmake/arhost)
include(CMakePackageConfigHelpers)
set(plugin_directory lib/arhost/plugins)
configure_package_config_file(cmake/arhostConfig.cmake.in arhostConfig.cmake INSTALL_DESTINATION lib/cmake/arhost
                              PATH_VARS plugin_directory)
# Before 1.0, minor versions may be incompatible.
write_basic_package_version_file(arhostConfigVersion.cmake COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
configure_file(cmake/arhost.pc.in arhost.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/arhostConfig.cmake ${PROJECT_BINARY_DIR}/arhostConfigVersion.cmake
              cmake/arhost_add_plugin.cmake cmake/plugin.map DESTINATION lib/cmake/arhost)
install(FILES ${PROJECT_BINARY_DIR}/arhost.pc DESTINATION lib/pkgconfig)
install(DIRECTORY sdk/ DESTINATION share/arhost PATTERN target EXCLUDE PATTERN Cargo.lock EXCLUDE)

# Examples and documentation
install(DIRECTORY config DESTINATION share/arhost)
install(FILES docs/arhost.schema.json DESTINATION share/arhost)
file(GLOB documents CONFIGURE_DEPENDS docs/*.md)
install(FILES README.md CHANGELOG.md ${documents} DESTINATION share/doc/arhost)
install(DIRECTORY docs/images DESTINATION share/doc/arhost)
install(FILES LICENSE DESTINATION share/doc/arhost RENAME copyright)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "arhost <arhost@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Ray-traced objects over live video, and the SDK for its plugins")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SECTION video)
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "python3-numpy, libvulkan1, mesa-vulkan-drivers")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "cmake, g++, cargo, gdb")
include(CPack)
