set(headers add_columns_impl.hpp blendshapes.hpp landmark_map.hpp morphable_model.hpp pca_model.hpp)
