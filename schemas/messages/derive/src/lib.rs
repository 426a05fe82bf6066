//! `#[derive(Message)]`: the run-time description of a message, from its declaration alone.
//!
//! The derive reads the field names, types and doc comments of a `#[repr(C)]` struct and implements
//! `messages::Message` and `messages::Field` for it. A variable part is named with
//! `#[message(element = Type)]`.

use proc_macro::TokenStream;
use quote::quote;
use syn::{Attribute, Data, DeriveInput, Expr, Fields, Lit, Meta, Type, parse_macro_input};

/// Describes a `#[repr(C)]` struct of fields that implement `messages::Field`.
#[proc_macro_derive(Message, attributes(message))]
pub fn derive_message(input: TokenStream) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    expand(&input).unwrap_or_else(|error| error.to_compile_error()).into()
}

fn expand(input: &DeriveInput) -> syn::Result<proc_macro2::TokenStream> {
    let Data::Struct(data) = &input.data else {
        return Err(syn::Error::new_spanned(&input.ident, "a message is a struct of plain fields"));
    };
    let Fields::Named(fields) = &data.fields else {
        return Err(syn::Error::new_spanned(&input.ident, "a message names its fields"));
    };
    if !is_repr_c(&input.attrs) {
        return Err(syn::Error::new_spanned(
            &input.ident,
            "a message needs #[repr(C)], so that every compiler lays it out alike",
        ));
    }
    let name = &input.ident;
    let text = name.to_string();
    let doc = doc_of(&input.attrs);
    let element = element_of(&input.attrs)?;
    let described = fields.named.iter().map(|field| {
        let ident = field.ident.as_ref().expect("named fields have names");
        let field_name = ident.to_string();
        let field_doc = doc_of(&field.attrs);
        let ty = &field.ty;
        quote! {
            ::messages::FieldDescription {
                name: #field_name.into(),
                kind: <#ty as ::messages::Field>::kind(),
                offset: ::core::mem::offset_of!(#name, #ident),
                unit: ::messages::unit_of(#field_name).into(),
                doc: #field_doc.into(),
            }
        }
    });
    let record = quote! {
        ::messages::Description {
            name: #text.into(),
            doc: #doc.into(),
            size: ::core::mem::size_of::<#name>(),
            alignment: ::core::mem::align_of::<#name>(),
            fields: ::std::vec![#(#described),*],
            element: ::core::option::Option::None,
        }
    };
    let has_elements = element.is_some();
    let (element_type, element_kind) = match element {
        Some(ty) => (quote!(#ty), quote!(::core::option::Option::Some(<#ty as ::messages::Field>::kind()))),
        None => (quote!(::messages::NoElement), quote!(::core::option::Option::None)),
    };
    Ok(quote! {
        impl ::messages::Field for #name {
            fn kind() -> ::messages::Kind {
                ::messages::Kind::Record(::std::boxed::Box::new(#record))
            }
        }
        impl ::messages::Message for #name {
            type Element = #element_type;
            const HAS_ELEMENTS: bool = #has_elements;
            const NAME: &'static str = #text;
            fn description() -> ::messages::Description {
                let mut description = #record;
                description.element = #element_kind;
                description
            }
        }
    })
}

fn is_repr_c(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("repr")
            && matches!(&attribute.meta, Meta::List(list) if list.tokens.to_string().split(',').any(|word| word.trim() == "C"))
    })
}

fn element_of(attributes: &[Attribute]) -> syn::Result<Option<Type>> {
    let mut element = None;
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("message")) {
        attribute.parse_nested_meta(|meta| {
            if meta.path.is_ident("element") {
                element = Some(meta.value()?.parse::<Type>()?);
                Ok(())
            } else {
                Err(meta.error("expected `element = Type`"))
            }
        })?;
    }
    Ok(element)
}

fn doc_of(attributes: &[Attribute]) -> String {
    let lines = attributes.iter().filter_map(|attribute| match &attribute.meta {
        Meta::NameValue(pair) if pair.path.is_ident("doc") => match &pair.value {
            Expr::Lit(literal) => match &literal.lit {
                Lit::Str(text) => Some(text.value().trim().to_owned()),
                _ => None,
            },
            _ => None,
        },
        _ => None,
    });
    lines.collect::<Vec<_>>().join(" ").trim().to_owned()
}
