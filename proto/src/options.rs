//! How the options of requests are declared.

/// Declares options: what is left out has its default, and what has its default is not written.
/// Those of requests that code frames are `coded`.
macro_rules! options {
    ($(#[$meta:meta])* pub struct $name:ident { $($fields:tt)* }) => {
        $crate::options::options! { @declare [$(#[$meta])*] $name { $($fields)* } }
    };
    ($(#[$meta:meta])* pub coded struct $name:ident { $($fields:tt)* }) => {
        $crate::options::options! { @declare [$(#[$meta])*] $name {
            $($fields)*
            /// Code the frames in groups so that no point is farther from its place than this
            /// fraction of the diagonal. At most one of `max_error`, `mean_error`, `target_size`
            /// and `quality` is given; without any, cages alone are stored.
            #[schema(exclusive_minimum = 0, exclusive_maximum = 1)]
            max_error: Option<f64>,
            /// As `max_error`, but for the mean over frames of the root mean square error.
            #[schema(exclusive_minimum = 0, exclusive_maximum = 1)]
            mean_error: Option<f64>,
            /// Most bytes of the container; the number of frames has to be known.
            #[schema(minimum = 1)]
            target_size: Option<u64>,
            /// `preview` (cages alone), `standard` (errors that are not seen) or `master` (as
            /// `max_error` 1e-4).
            #[schema(pattern = "^(preview|standard|master)$")]
            quality: Option<String>,
            /// Keep the model at rest and its cage exactly, where one of these four allows less.
            exact_rest: bool,
        } }
    };
    (@declare [$(#[$meta:meta])*] $name:ident { $($(#[$attribute:meta])* $field:ident: $type:ty,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, Default, PartialEq, serde::Deserialize, serde::Serialize, utoipa::ToSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $(
                $(#[$attribute])*
                #[serde(skip_serializing_if = "crate::options::is_default")]
                pub $field: $type,
            )*
        }
    };
}
pub(crate) use options;

/// Whether a value is what it is where it is left out.
pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
